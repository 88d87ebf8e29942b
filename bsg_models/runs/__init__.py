"""Trained models on disk: run folders, checkpoints, and the predictor that asks them."""
