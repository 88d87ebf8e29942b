"""Make synthetic buildings in the file layout of HM3D, with and without meshes."""
