"""Read semantic meshes: boxes of objects and rooms, storeys, and adjacent rooms."""
