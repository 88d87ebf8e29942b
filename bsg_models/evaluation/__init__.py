"""Metrics, and their measurement on masked pairs with intervals over buildings."""
