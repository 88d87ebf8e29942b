"""Define beliefs about hidden objects: count distributions, expectations, belief graphs, files."""
