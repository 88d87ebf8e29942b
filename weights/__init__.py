"""Shipped models: data files only; `bsg_models.runs.found_model` finds them."""
