"""The catalogue of exports: one row per format, and the entry points of `bsg_data.exports`.

A row encodes one scene at a time; `bsg_data.exports.export` writes the files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

from bsg_data.registry import Registry
from bsg_data.scene.scene_graph import SceneGraph


@dataclass(frozen=True, slots=True)
class EncodedScene:
    """One scene in another format.

    Attributes:
        files: file name → bytes; empty for a scene without content for the format.
        rooms: number of rooms in the files.
        note: what a reader must know of the scene; equal words for similar scenes.
        objects: number of objects in the files; 0 for a format of rooms alone.
    """

    files: Mapping[str, bytes]
    rooms: int
    note: str | None = None
    objects: int = field(default=0, kw_only=True)


@dataclass(frozen=True, slots=True)
class ExportRow:
    """One row of the exports.

    Attributes:
        summary: what the format holds, in one line.
        encode: function that encodes a scene; it also gets the names of the classes, by index.
    """

    summary: str
    encode: Callable[[SceneGraph, tuple[str, ...]], EncodedScene]


EXPORTS = Registry(
    "export",
    ExportRow,
    group="bsg_data.exports",
    rows={
        "graphml": "bsg_data.exports.building_graphs:GRAPHML",
        "networkx": "bsg_data.exports.building_graphs:NODE_LINK",
        "habitat": "bsg_data.exports.habitat:ROW",
        "table": "bsg_data.exports.object_table:ROW",
    },
)
