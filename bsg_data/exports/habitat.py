"""Write rooms for habitat-sim: `<scene>.semantic_config.json` with `region_annotations`.

habitat-sim reads these numbers in the axes of its world: metres, Y up, -Z to the front. A point is
in a region if it lies within the bounds, its y is between `floor_height` and `floor_height` +
`extrusion_height`, and (x, z) is inside `poly_loop` (habitat-sim 0.3, SemanticScene.cpp). Datasets
are Z up: their (x, y, z) becomes (x, z, -y). This holds for meshes with any up axis, if the stage
has the right `up` and `front`, which a note says. `bsg_data.sources.layout_files` reads these
files.
"""

from __future__ import annotations

import re

from bsg_data.exports.catalogue import EncodedScene, ExportRow
from bsg_data.files import encode_json
from bsg_data.geometry.placement import UPRIGHT
from bsg_data.scene.scene_graph import Box, Point, Room, SceneGraph
from bsg_data.sources.layout_files import CONFIG_SUFFIX, NO_LABEL

_POINT = re.compile(r"\[\n *([^\n]+),\n *([^\n]+),\n *([^\n{}\[\]]+)\n *\]")  # as JSON, over lines


def _encode_regions(graph: SceneGraph, _: tuple[str, ...] = ()) -> EncodedScene:
    """Encode the rooms that have a box as regions, in their order."""
    regions = [_region(room, room.box) for room in graph.rooms if room.box is not None]
    if not regions:
        return EncodedScene({}, 0)
    text = encode_json({"region_annotations": regions}, indent=2, ensure_ascii=False)
    data = (_POINT.sub(r"[\1, \2, \3]", text) + "\n").encode()
    note = None
    if graph.up_axis is not None:
        front, up = UPRIGHT[graph.up_axis][1:]
        axes = f'"up": {[*up]}, "front": {[*front]}'  # by which it stands upright
        note = f"stages whose mesh has {graph.up_axis} up need {axes}"
    return EncodedScene({f"{graph.scene_id}{CONFIG_SUFFIX}": data}, len(regions), note)


def _region(room: Room, box: Box) -> dict[str, object]:
    """Return the region of a room: its footprint from the bottom of its box to the top."""
    (a, b, floor), (c, d, ceiling) = box.minimum, box.maximum
    corners = room.footprint or ((a, b), (c, b), (c, d), (a, d))
    return {
        "name": f"region_{room.region_id}",
        "label": room.label or room.source_label or NO_LABEL,
        "poly_loop": [_turn((x, y, floor)) for x, y in corners],
        "floor_height": float(floor),
        "extrusion_height": round(float(ceiling - floor), 6),
        "min_bounds": _turn((a, d, floor)),
        "max_bounds": _turn((c, b, ceiling)),
    }


def _turn(point: Point) -> Point:
    """Return a point of a dataset in the axes of habitat-sim's world."""
    x, y, z = point
    return float(x), float(z), 0.0 - y  # and never -0.0


ROW = ExportRow(
    summary="rooms with a box as habitat-sim's region_annotations, <scene>.semantic_config.json",
    encode=_encode_regions,
)
