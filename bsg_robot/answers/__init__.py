"""Answers to questions of a robot: where things are, where to go; in NumPy alone."""
