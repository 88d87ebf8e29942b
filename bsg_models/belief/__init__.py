"""Beliefs about what is hidden: count distributions, expectations, belief graphs, their files."""
