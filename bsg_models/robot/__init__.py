"""What a robot asks: where things are, what a room holds, where to go next; in names and ids."""
