"""Room layouts: `bsg_data.sources.room_layouts`."""

from __future__ import annotations

from pathlib import Path

from bsg_data.scene.scene_graph import Room, SceneGraph
from bsg_data.sources.room_layouts import lay_out, read_layout
from fuzz.target import Target, put

_LAYOUT = b"""rooms:
  room_1:
    label: kitchen
    centroid: {x: 1.0, y: 1.25, z: -2.0}
    dims: {x: 2.0, y: 2.5, z: 4.0}
  room_2:
    label: "h\xc3\xa4llway"
    centroid: {x: 4, y: 4, z: -2}
    dims: {x: 2, y: 2, z: 1}
connections:
- [1, 2]
"""
_GRAPH = SceneGraph(
    scene_id="s",
    source="hm3d",
    source_version=None,
    source_split=None,
    annotation_sha256="0" * 64,
    rooms=tuple(Room(number, number) for number in range(1, 4)),
    objects=(),
    class_map="hm3d45-v2",
)


def seeds() -> dict[str, bytes]:
    """Return a layout."""
    return {"layout": _LAYOUT}


def read(folder: Path, data: bytes) -> object:
    """Read a layout, and lay out a building of three rooms by it."""
    return lay_out(_GRAPH, read_layout(put(folder, ".yaml", data)))


TARGET = Target(
    name="layout",
    read=read,
    seeds=seeds,
    words=(
        *("room_3", "&a", "*a", "<<: ", "!!python/object:x", "? ", "|\n", "%YAML 1.2", "---\n"),
        *(".nan", ".inf", "0x1f", "1_000", "[" * 40, "{", "- ", "\t", "#", "'", "\u2028", "\x00"),
    ),
    most=400,
)
