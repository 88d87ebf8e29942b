"""A record of how much of a mesh the annotation of its scene explains."""

from __future__ import annotations

from pydantic import Field

from bsg_data.recipes import Record


class MeshCoverage(Record):
    """How much of a mesh its annotation explains.

    Attributes:
        sha256: hash of the mesh file.
        texels: number of texels in all textures, the sum of the next four.
        listed: texels with the exact colour of an instance.
        snapped: texels of JPEG textures that got the nearest instance colour.
        black: black texels, the background, unless black is the colour of an instance.
        unlisted: texels of any other colour.
        unlisted_colours: number of these other colours.
        faces: number of triangles.
        area: surface of all triangles, square metres, the sum of the next three.
        listed_area: surface of instances.
        unlisted_area: surface in colours that no instance has.
        uncoloured_area: surface with neither texture nor vertex colours.
        without_geometry: number of listed instances without a surface.
    """

    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    texels: int = 0
    listed: int = 0
    snapped: int = 0
    black: int = 0
    unlisted: int = 0
    unlisted_colours: int = 0
    faces: int = 0
    area: float = 0.0
    listed_area: float = 0.0
    unlisted_area: float = 0.0
    uncoloured_area: float = 0.0
    without_geometry: int = 0
