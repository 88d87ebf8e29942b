"""Write rooms for habitat-sim: `<scene>.semantic_config.json` with `region_annotations`.

habitat-sim reads these numbers in the axes of its world: Y up, -Z to the front. A point is in a
region if it lies within the bounds, its y is between `floor_height` and `floor_height` +
`extrusion_height`, and (x, z) is inside `poly_loop` (habitat-sim 0.3, SemanticScene.cpp). Datasets
are Z up: their (x, y, z) becomes (x, z, -y). This holds for meshes with any up axis, if the stage
has the right `up` and `front`; see `find_orientation`.
"""

from __future__ import annotations

import re
from typing import Annotated

from pydantic import Field

from bsg_data.exports.catalogue import EncodedScene, ExportRow
from bsg_data.files import encode_json
from bsg_data.geometry.placement import UPRIGHT
from bsg_data.recipes import Record
from bsg_data.scene.scene_graph import Point, Room, SceneGraph

SUFFIX = ".semantic_config.json"
_POINT = re.compile(r"\[\n *([^\n]+),\n *([^\n]+),\n *([^\n{}\[\]]+)\n *\]")  # as JSON, over lines
_NO_LABEL = "room"  # habitat-sim makes a category of every label

Metres = Annotated[float, Field(allow_inf_nan=False)]
Place = tuple[Metres, Metres, Metres]


class Region(Record):
    """One region, in the axes of habitat-sim's world: metres, Y up.

    Attributes:
        name: unique in its scene.
        label: the name of its category.
        poly_loop: corners of its floor.
        floor_height: y of its floor.
        extrusion_height: metres from its floor to its ceiling.
        min_bounds: lowest corner of its box.
        max_bounds: highest corner of its box.
    """

    name: str
    label: str
    poly_loop: Annotated[tuple[Place, ...], Field(min_length=3)]
    floor_height: Metres
    extrusion_height: Annotated[Metres, Field(ge=0)]
    min_bounds: Place
    max_bounds: Place


class SemanticConfig(Record):
    """The regions of one scene.

    Attributes:
        region_annotations: a record each.
    """

    region_annotations: tuple[Region, ...]


def find_orientation(up_axis: str) -> tuple[Point, Point]:
    """Return the `up` and `front` that place a stage upright in habitat-sim.

    Args:
        up_axis: up axis of the mesh file, `scenes.up_axis`.

    >>> find_orientation("y"), find_orientation("z")
    (((0, 1, 0), (0, 0, -1)), ((0, 0, 1), (0, 1, 0)))
    """
    _, front, up = UPRIGHT[up_axis]
    return up, front


def list_regions(graph: SceneGraph) -> tuple[Region, ...]:
    """Return the regions of the rooms that have a box, in their order."""
    return tuple(region for room in graph.rooms if (region := _region(room)) is not None)


def encode_regions(regions: tuple[Region, ...]) -> bytes:
    """Return the bytes of a `semantic_config.json`; `decode_regions` reads them back."""
    config = SemanticConfig(region_annotations=regions).model_dump()
    text = encode_json(config, indent=2, ensure_ascii=False)
    return (_POINT.sub(r"[\1, \2, \3]", text) + "\n").encode()


def decode_regions(data: bytes) -> tuple[Region, ...]:
    """Return the regions of a `semantic_config.json`.

    Raises:
        pydantic.ValidationError: if it is none, or has other entries.
    """
    return SemanticConfig.model_validate_json(data).region_annotations


def _region(room: Room) -> Region | None:
    """Return the region of a room: its footprint from the bottom of its box to the top."""
    if room.box is None:
        return None
    (a, b, floor), (c, d, ceiling) = room.box.minimum, room.box.maximum
    corners = room.footprint or ((a, b), (c, b), (c, d), (a, d))
    return Region(
        name=f"region_{room.region_id}",
        label=room.label or room.source_label or _NO_LABEL,
        poly_loop=tuple(_turn((x, y, floor)) for x, y in corners),
        floor_height=floor,
        extrusion_height=round(ceiling - floor, 6),
        min_bounds=_turn((a, d, floor)),
        max_bounds=_turn((c, b, ceiling)),
    )


def _turn(point: Point) -> Point:
    """Return a point of a dataset in the axes of habitat-sim's world."""
    x, y, z = point
    return x, z, 0.0 - y  # and never -0.0


def _encode(graph: SceneGraph) -> EncodedScene:
    regions = list_regions(graph)
    if not regions:
        return EncodedScene({}, 0)
    note = None
    if graph.up_axis is not None:
        up, front = (list(axis) for axis in find_orientation(graph.up_axis))
        note = f'stages whose mesh has {graph.up_axis} up need "up": {up}, "front": {front}'
    return EncodedScene({f"{graph.scene_id}{SUFFIX}": encode_regions(regions)}, len(regions), note)


ROW = ExportRow(
    summary="rooms with a box as habitat-sim's region_annotations, <scene>.semantic_config.json",
    encode=_encode,
)
