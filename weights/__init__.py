"""Shipped models: data files only; `bsg_models.runs.shipped` finds them."""
