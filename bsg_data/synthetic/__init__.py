"""Synthetic buildings in HM3D's own layout, with and without meshes."""
