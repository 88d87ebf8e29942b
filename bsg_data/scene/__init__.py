"""The records of a 3D scene graph, and the class maps that name its objects."""
