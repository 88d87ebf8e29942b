"""Test your own formats of belief graphs: a contract to inherit from (docs/extending.md)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from bsg_data.errors import BSGError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box
from bsg_models.belief.belief_graph import BeliefGraph, BlindNode, believe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import (
    Custom,
    KnownRoom,
    Look,
    PartialGraph,
    Remembered,
    SeenObject,
    Sighting,
)
from bsg_robot.graph.formats import FORMATS, choose_format, write_beliefs


class FormatContract:
    """The contract of every format."""

    name: ClassVar[str]  # of the format's row in `FORMATS`, or of its entry point

    def beliefs(self) -> list[BeliefGraph]:
        """Return belief graphs: an empty one, and one with hostile names."""
        return [make_belief("empty", names=()), make_belief("hostile", names=HOSTILE)]

    def write(self, beliefs: Sequence[BeliefGraph], path: Path) -> None:
        """Write one belief graph, or any number if the format holds many."""
        row = FORMATS[self.name]
        if row.write_all is not None or row.write is not None:
            write_beliefs(beliefs, path, row)

    def read(self, path: Path) -> list[BeliefGraph] | None:
        """Read the output of `write`; None if the format cannot be read."""
        row = FORMATS[self.name]
        return None if row.read is None else [row.read(path)]

    def path_in(self, folder: Path) -> Path:
        """Return a path with the suffix of the format."""
        return folder / f"belief{FORMATS[self.name].suffixes[0]}"

    def test_its_suffix_is_its_own(self) -> None:
        """Check that each of its suffixes chooses the format."""
        row = FORMATS[self.name]
        assert row.name == self.name
        for suffix in row.suffixes:
            assert choose_format(Path(f"belief{suffix}")) is row

    def test_what_is_written_is_read(self, tmp_path: Path) -> None:
        """Check that equal graphs are read back, also over an older file."""
        path, row = self.path_in(tmp_path), FORMATS[self.name]
        if row.write is None and row.write_all is None:
            return
        for belief in self.beliefs():
            self.write([belief], path)
            assert path.exists()
            assert self.read(path) in (None, [belief])
        if row.write_all is not None:
            self.write(self.beliefs(), path)
            assert self.read(path) in (None, self.beliefs())

    def test_nothing_half_written_stays(self, tmp_path: Path) -> None:
        """Check that a failed write leaves the older file, and nothing else."""
        belief, path = self.beliefs()[1], self.path_in(tmp_path)
        broken = replace(belief, blind=(*belief.blind, BlindNode(1, 10**6, 1.0, 0.5)))
        for older in (False, True):
            if older:
                self.write([belief], path)
            before = _bytes_below(tmp_path)
            try:
                self.write([broken], path)
            except Exception:  # the class does not exist; each format raises its own error
                assert _bytes_below(tmp_path) == before

    def test_what_is_no_such_file_is_refused(self, tmp_path: Path) -> None:
        """Check that garbage and a missing file raise an error of this project."""
        path = self.path_in(tmp_path)
        row = FORMATS[self.name]
        if row.read is None:
            return
        for content in (None, b"", b"\x00garbage", b"[]"):
            if content is not None:
                path.write_bytes(content)
            refused = False
            try:
                self.read(path)
            except BSGError:
                refused = True
            assert refused, f"expected an error of this project for {content!r}"


SECONDS = 1_796_000_000.125  # a time
HOSTILE = ('</script><img src=x onerror="alert(1)">', 'a,"b"\n\tc', "Küche \u2028 ☃", "zzqx")


def make_belief(scene_id: str, *, names: Sequence[str]) -> BeliefGraph:
    """Return a belief graph with a room and an object of each name; the first room has a box."""
    class_map = load_class_map()
    rooms = tuple(
        KnownRoom(
            f"room {i}",
            0.5,
            i % 2 == 0,
            name,
            (0.5, 0.1, 1 / 3) if i == 0 else None,
            Box((0.0, 0.0, 0.0), (1.0, 0.2, 2 / 3)) if i == 0 else None,
            ((0.0, 0.0), (1.0, 0.0), (1.0, 0.2)) if i == 0 else None,
            0 if i == 0 else None,
        )
        for i, name in enumerate(names)
    )
    objects = tuple(
        SeenObject(
            *(str(i), min(i, len(rooms)), name, known.category, known.class_index),
            score=0.75,
            time=SECONDS + i / 4,
            stays=12.5,
        )
        for i, name in enumerate(["bed", *names] if names else [])
        for known in [class_map.classify(name)]
    )
    pairs = tuple((a, a + 1) for a in range(1, len(rooms)))
    graph = PartialGraph(scene_id, class_map.space, 0.25, rooms, objects, pairs)
    if names:
        seen = tuple(Sighting(SECONDS - day, day % 3, names[0]) for day in (2, 1))
        graph = replace(
            graph,
            now=SECONDS + 3600,
            stays=48.0,
            looks=(Look(1, names[1], 0.5, time=SECONDS),),
            memory=(Remembered("1", names[1], seen), Remembered("gone", names[2], seen)),
            customs=(Custom(names[2], 1, names[3]), Custom(names[3], None, "bed", never=True)),
        )
    inputs = graph.histograms().astype(float)
    hidden = np.random.default_rng(0).gamma(0.1, 1.0, inputs.shape)
    return believe(graph, Expectation(inputs, poisson(hidden)), model=scene_id)


def _bytes_below(folder: Path) -> dict[str, bytes]:
    files = (path for path in sorted(folder.rglob("*")) if path.is_file())
    return {path.relative_to(folder).as_posix(): path.read_bytes() for path in files}
