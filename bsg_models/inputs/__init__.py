"""Prepare what models read: masked buildings as graphs, their edges, and folds."""
