"""Answer a robot's questions: where things are, what a room holds, where to go next."""
