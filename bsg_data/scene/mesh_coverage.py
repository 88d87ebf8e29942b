"""What is known of a mesh as a whole: how much of it the annotation of its scene explains."""

from __future__ import annotations

from pydantic import Field

from bsg_data.recipes import Record


class MeshCoverage(Record):
    """How much of a mesh its annotation explains.

    Attributes:
        sha256: of the file.
        texels: in all textures: the sum of the next four.
        listed: texels with the exact colour of an instance.
        snapped: texels of JPEG textures taken for the nearest instance colour.
        black: texels of no colour, which is the background, if black is no instance's.
        unlisted: texels of any other colour.
        unlisted_colours: how many colours these are.
        faces: triangles.
        area: of all triangles, square metres: the sum of the next three.
        listed_area: of instances.
        unlisted_area: of colours that no instance has.
        uncoloured_area: of triangles with neither texture nor vertex colours.
        without_geometry: instances that are listed and have no surface.
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
