"""Make synthetic buildings in the file layout of HM3D, with room layouts."""
