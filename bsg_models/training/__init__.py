"""Training: epochs, optimisers, learning curves."""
