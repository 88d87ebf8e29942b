"""What every format of belief graphs and every export keeps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import pytest
from random_beliefs import make_belief

from bsg_data.errors import BSGError
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP
from bsg_data.scene.class_space import load_class_space
from bsg_data.scene.scene_graph import BUILDING, Box, Room, SceneGraph, SceneObject
from bsg_models.belief.belief_graph import BlindNode
from bsg_robot.graph.formats import FORMATS, choose_format, write_beliefs

GARBAGE = (None, b"", b"\x00garbage", b"[]")  # None: no file


class FormatContract:
    """A format keeps the graphs, and a failed write the older file."""

    name: ClassVar[str]

    def path_in(self, folder: Path) -> Path:
        return folder / f"belief{FORMATS[self.name].suffixes[0]}"

    def test_what_is_written_is_read(self, tmp_path: Path) -> None:
        """Also over an older file; each of its suffixes chooses the format."""
        row, path = FORMATS[self.name], self.path_in(tmp_path)
        assert all(choose_format(Path(f"belief{suffix}")) is row for suffix in row.suffixes)
        for belief in (make_belief(seed) for seed in range(12)):
            if row.write or row.write_all:
                write_beliefs([belief], path, row)
                assert path.exists()
                assert row.read is None or row.read(path) == belief

    def test_nothing_half_written_stays(self, tmp_path: Path) -> None:
        row, path, belief = FORMATS[self.name], self.path_in(tmp_path), make_belief(10)
        broken = replace(belief, blind=(*belief.blind, BlindNode(1, 10**6, 1.0, 0.5)))
        for older in (False, True):
            if older and (row.write or row.write_all):
                write_beliefs([belief], path, row)
            before = read_all(tmp_path)
            try:
                write_beliefs([broken], path, row)
            except Exception:  # the class does not exist; each format raises its own error
                assert read_all(tmp_path) == before

    @pytest.mark.parametrize("content", GARBAGE)
    def test_what_is_no_such_file_is_refused(self, content: bytes | None, tmp_path: Path) -> None:
        row, path = FORMATS[self.name], self.path_in(tmp_path)
        if content is not None:
            path.write_bytes(content)
        if row.read is not None:
            with pytest.raises(BSGError):
                row.read(path)


def read_all(folder: Path) -> dict[Path, bytes]:
    return {path: path.read_bytes() for path in folder.rglob("*") if path.is_file()}


def make_graphs() -> Iterator[SceneGraph]:
    """Yield buildings with and without places and objects, and one without rooms."""
    box = Box((0.0, 0.0, 0.0), (4.0, 3.0, 2.5))
    outline = ((0.0, 0.0), (4.0, 0.0), (4.0, 3.0), (0.0, 3.0))
    placed = Room(1, 0, "kitchen", (2.0, 1.5, 1.25), box, 0, 0.0, outline, "kitchen", 12.0)
    index = load_class_space().class_index("stove")
    stove = SceneObject(1, 4, 1, "Stove", "stove", index, "classified", None, (1, 1, 0.5), box)
    things = stove, SceneObject(2, 7, BUILDING, "zzqx")
    for number, rooms in enumerate(((placed, Room(2, 5)), (Room(1, 0),), ())):
        yield SceneGraph(
            scene_id=f"0000{number}-building",
            source="table",
            source_version=None,
            source_split=None,
            annotation_sha256="0" * 64,
            rooms=rooms,
            objects=() if number else things,
            class_map=DEFAULT_CLASS_MAP,
        )
