"""Read the public statistics of HM3DSem: corrected name, scene and region of each instance.

There are no meshes. `HM3DSem-v0.2.zip` holds `Per_Scene_Region_Neighborhoods.csv`: one row per
region, with its instances as `<corrected name>_<instance id>`, joined by colons. The header has a
sixth name without a column.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import ClassVar

from bsg_data.errors import AnnotationError
from bsg_data.inputs.bounded_file import read_member
from bsg_data.inputs.text_table import parse_csv
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.annotation_files import (
    decode,
    fetch_listed,
    keep_one_copy,
    malformed,
    state_of,
)
from bsg_data.sources.assembly import assemble
from bsg_data.sources.hm3d import MATTERPORT, split_by_number, split_scene_id, version_of
from bsg_data.sources.source import Annotation, FoundScenes, Reading, SceneRef, SourceRow

MEMBER = "Per_Scene_Region_Neighborhoods.csv"
HEADER = (
    "Scene Name",
    "Region #",
    "# Unique Categories",
    "# Objects",
    "Object Instances in Region",
)
_WHOLE = re.compile(r"-?[0-9]{1,9}")
_TOKEN = re.compile(r"(.*)_([0-9]{1,9})", re.DOTALL)


@dataclass(frozen=True)
class HM3DStatistics:
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
            for name, lines in self._lines.items()
        ]
        return keep_one_copy(refs, path=self.path, expected="the table of regions has no row")

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene from its rows."""
        lines = fetch_listed(ref, self.path, lambda: self._lines[ref.location], _digest)
        listed = [*_parse_scene(lines, path=self.path)]
        annotation = Annotation(
            [region for _, region, _ in listed],
            [name for _, _, name in listed],
            ids=[number for number, _, _ in listed],
        )
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))

    @property
    def _lines(self) -> dict[str, list[tuple[int, str]]]:
        return _read_scene_lines(self.path, *state_of(self.path))


@lru_cache(maxsize=2)
def _read_scene_lines(
    path: Path, size: int = 0, changed: int = 0
) -> dict[str, list[tuple[int, str]]]:
    """Read the numbered lines of every scene, sorted by id, once for each state of the zip."""
    scenes: dict[str, list[tuple[int, str]]] = {}
    text = decode(read_member(path, MEMBER), path=path / MEMBER)
    header, *lines = text.replace("\r\n", "\n").split("\n")
    if tuple(header.split(",")[: len(HEADER)]) != HEADER:
        raise malformed(path / MEMBER, 1, header, expected=",".join(HEADER))
    for number, line in enumerate(lines, start=2):
        if line.strip():
            scenes.setdefault(line.split(",", 1)[0], []).append((number, line))
    return dict(sorted(scenes.items()))


def _digest(lines: list[tuple[int, str]]) -> str:
    """Return the sha256 of the lines of one scene, joined by line feeds."""
    return hashlib.sha256("\n".join(line for _, line in lines).encode()).hexdigest()


def _parse_scene(lines: list[tuple[int, str]], *, path: Path) -> Iterator[tuple[int, int, str]]:
    """Yield id, region and name of the objects of one scene."""
    regions: set[int] = set()
    seen: set[int] = set()
    for number, line in lines:

        def fault(text: str, expected: str, number: int = number) -> AnnotationError:
            return malformed(path / MEMBER, number, text, expected=expected)

        row = _split_row(line, fault)
        region, tokens = int(row[1]), row[4].split(":") if row[4] else []
        if region in regions:
            raise fault(line, f"region {region} of this scene once")
        regions.add(region)
        if len(tokens) != int(row[3]):
            raise fault(line, f"{row[3]} instances as the row says ({len(tokens)} are listed)")
        for token in tokens:
            match = _TOKEN.fullmatch(token)
            if match is None:
                raise fault(token, "<name>_<instance id>")
            if (instance_id := int(match[2])) in seen:
                raise fault(token, "an instance id that no earlier region of the scene has")
            seen.add(instance_id)
            yield instance_id, region, match[1]


def _split_row(line: str, fault: Callable[[str, str], AnnotationError]) -> list[str]:
    try:
        _, row = next(parse_csv([line]))
    except ValueError as error:
        why = str(error).partition(": ")[2]
        raise fault(line, f"a row of comma separated values ({why})") from error
    if len(row) != len(HEADER) or not _WHOLE.fullmatch(row[1]) or not _WHOLE.fullmatch(row[3]):
        raise fault(line, f"{','.join(HEADER)}, with whole numbers as region and # Objects")
    return row


ROW = SourceRow(
    summary="the public zip of HM3DSem's statistics: corrected names, no meshes",
    open=HM3DStatistics,
    terms=MATTERPORT,
)
