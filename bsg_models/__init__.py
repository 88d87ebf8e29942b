"""Beliefs: models, metrics, expectation, belief graphs and search."""
