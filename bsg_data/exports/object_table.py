"""Write buildings as tables of objects, which the source `table` reads, so that one can mend them.

A room is named by its region id. Joined files, `cat *.objects.csv`, are one table.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Iterator, Mapping
from typing import Any

from bsg_data.exports.catalogue import EncodedScene, ExportRow
from bsg_data.scene.scene_graph import Box, Point, SceneGraph

_PLACE = ("x", "y", "z")
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in _PLACE)
_COLUMNS = (
    *("scene", "room", "category", "room_label", "floor", "floor_area", "connected"),
    *(*_PLACE, *_BOX),
)
_NAMELESS = "unknown"  # a row without a category would be an empty room


def _encode(graph: SceneGraph) -> EncodedScene:
    text = io.StringIO()
    writer = csv.DictWriter(text, _COLUMNS, lineterminator="\n")
    writer.writeheader()
    writer.writerows({"scene": graph.scene_id, **row} for row in _list_rows(graph))
    files = {f"{graph.scene_id}.objects.csv": text.getvalue().encode()}
    return EncodedScene(files, len(graph.rooms), objects=len(graph.objects))


def _list_rows(graph: SceneGraph) -> Iterator[Mapping[str, Any]]:
    """Yield a row for every room, then one for every object."""
    names = {room.room_index: room.region_id for room in graph.rooms}
    for room in graph.rooms:
        others = (edge.target for edge in graph.adjacency if edge.source == room.room_index)
        yield {
            "room": room.region_id,
            "room_label": room.label or room.source_label,
            "floor": room.floor_index,
            "floor_area": room.floor_area,
            "connected": ";".join(str(names[other]) for other in others),
        }
    for obj in graph.objects:
        yield {
            "room": names.get(obj.room_index),
            "category": obj.raw_category or _NAMELESS,
            **_place(obj.centroid, obj.box),
        }


def _place(point: Point | None, box: Box | None) -> dict[str, float]:
    corners = dict(zip(_BOX, (*box.minimum, *box.maximum), strict=True)) if box else {}
    return {**dict(zip(_PLACE, point or (), strict=False)), **corners}


ROW = ExportRow(
    summary="objects and rooms as a table that the source table reads, <scene>.objects.csv",
    encode=lambda graph, _: _encode(graph),
)
