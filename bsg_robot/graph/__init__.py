"""What a robot knows of a building, and the files that hold it: JSON, Hydra, belief graphs."""
