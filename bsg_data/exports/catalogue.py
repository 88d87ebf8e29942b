"""The catalogue of exports: one row a format, then the entry points of `bsg_data.exports`.

A row encodes one scene at a time; `bsg_data.exports.export` does all that has to do with files.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from bsg_data.registry import Registry
from bsg_data.scene.scene_graph import SceneGraph


@dataclass(frozen=True, slots=True)
class EncodedScene:
    """One scene in another format.

    Attributes:
        files: their bytes by their names; none for a scene that has nothing for the format.
        rooms: how many rooms are in them.
        note: what its reader has to know of a scene, the same words for scenes that are alike.
    """

    files: Mapping[str, bytes]
    rooms: int
    note: str | None = None


@dataclass(frozen=True, slots=True)
class ExportRow:
    """One row of the exports.

    Attributes:
        summary: what it writes, in one line.
        encode: encodes a scene.
    """

    summary: str
    encode: Callable[[SceneGraph], EncodedScene]


EXPORTS = Registry(
    "export",
    ExportRow,
    group="bsg_data.exports",
    rows={"habitat": "bsg_data.exports.habitat:ROW"},
)
