"""What a robot has seen of a building: masks, masked pairs, partial graphs."""
