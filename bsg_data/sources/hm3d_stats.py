"""Read the public statistics of HM3DSem: corrected name, scene and region of each instance.

There are no meshes. `HM3DSem-v0.2.zip` holds `Per_Scene_Region_Neighborhoods.csv`: one row per
region, with its instances as `<corrected name>_<instance id>`, joined by colons. The header has a
sixth name without a column.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from bsg_data.inputs.bounded_file import read_member
from bsg_data.inputs.text_table import parse_csv
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.annotation_files import (
    decode,
    keep_one_copy,
    malformed,
    once_for_each_state,
)
from bsg_data.sources.assembly import assemble
from bsg_data.sources.hm3d import MATTERPORT, split_by_number, split_scene_id, version_of
from bsg_data.sources.source import Annotation, FoundScenes, Reading, SceneRef, SourceRow
from bsg_data.words.shown import SHOWN

MEMBER = "Per_Scene_Region_Neighborhoods.csv"
HEADER = (
    "Scene Name",
    "Region #",
    "# Unique Categories",
    "# Objects",
    "Object Instances in Region",
)
_WHOLE = re.compile(r"-?[0-9]{1,9}")
_ID = re.compile(r"[0-9]{1,9}")


_Lines = list[tuple[int, str]]  # numbers and texts


@dataclass(frozen=True)
class _HM3DStatistics:
    """The public zip of HM3DSem's statistics."""

    path: Path

    kind = "hm3d-stats"
    options: ClassVar[dict[str, int | str]] = {}

    def find(self) -> FoundScenes:
        """List the scenes of the zip."""
        refs = [
            SceneRef(
                scene_id=name,
                location=name,
                fingerprint=_digest(lines),
                source_split=split_by_number(name),
                source_version=version_of(self.path.name),
                building=split_scene_id(name)[1],
            )
            for name, lines in _read_scene_lines(self.path).items()
        ]
        return keep_one_copy(refs, path=self.path, expected="expected rows of regions, found none")

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene from its rows."""
        lines = _read_scene_lines(self.path)[ref.location]
        listed = [*_parse_scene(lines, path=self.path)]
        annotation = Annotation(
            [region for _, region, _ in listed],
            [name for _, _, name in listed],
            ids=[number for number, _, _ in listed],
        )
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))


@once_for_each_state
def _read_scene_lines(path: Path) -> dict[str, _Lines]:
    """Read the numbered lines of every scene, sorted by id."""
    scenes: dict[str, _Lines] = {}
    text = decode(read_member(path, MEMBER), path=path / MEMBER)
    header, *lines = text.replace("\r\n", "\n").split("\n")
    if not header.startswith(",".join(HEADER)):
        raise malformed(path / MEMBER, 1, header, expected=",".join(HEADER))
    for number, line in enumerate(lines, start=2):
        if line.strip():
            scenes.setdefault(line.split(",", 1)[0], []).append((number, line))
    return dict(sorted(scenes.items()))


def _digest(lines: _Lines) -> str:
    """Return the sha256 of the lines of one scene, joined by line feeds."""
    return hashlib.sha256("\n".join(line for _, line in lines).encode()).hexdigest()


def _parse_scene(lines: _Lines, *, path: Path) -> Iterator[tuple[int, int, str]]:
    """Yield id, region and name of the objects of one scene."""
    regions: set[int] = set()
    seen: set[int] = set()
    for number, line in lines:
        try:
            yield from _parse_row(line, regions, seen)
        except ValueError as error:
            raise malformed(path / MEMBER, number, line, expected=str(error)) from error


def _parse_row(line: str, regions: set[int], seen: set[int]) -> Iterator[tuple[int, int, str]]:
    """Yield the objects of a region; a ValueError says what was expected."""
    row: list[str] = []
    with suppress(ValueError):  # a quote that is not closed
        _, row = next(parse_csv(line.encode()))
    if len(row) != len(HEADER) or not all(map(_WHOLE.fullmatch, (row[1], row[3]))):
        raise ValueError(f"{','.join(HEADER)}, with whole numbers as region and # Objects")
    region, count, tokens = int(row[1]), int(row[3]), row[4].split(":") if row[4] else []
    if region in regions:
        raise ValueError(f"region {region} of this scene once")
    regions.add(region)
    if len(tokens) != count:
        raise ValueError(f"{count} instances as the row says ({len(tokens)} are listed)")
    for token in tokens:
        name, _, instance = token.rpartition("_")
        if not _ID.fullmatch(instance):
            raise ValueError(f"<name>_<instance id>, not {token[:SHOWN]!r}")
        if int(instance) in seen:
            raise ValueError(f"instance ids of no earlier region of the scene, not {instance}")
        seen.add(int(instance))
        yield int(instance), region, name


ROW = SourceRow(
    summary="the public zip of HM3DSem's statistics: corrected names, no meshes",
    open=_HM3DStatistics,
    terms=MATTERPORT,
)
