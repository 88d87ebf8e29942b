"""Read the public statistics of HM3DSem: corrected name, scene and region of each instance.

There are no meshes. `HM3DSem-v0.2.zip` holds `Per_Scene_Region_Neighborhoods.csv`: one row per
region, with its instances as `<corrected name>_<instance id>`, joined by colons. The header has a
sixth name without a column.
"""

from __future__ import annotations

import csv
import hashlib
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from bsg_data.errors import AnnotationError, SourceError
from bsg_data.files import AnyPath
from bsg_data.inputs.bounded_file import read_member
from bsg_data.inputs.bounds import STATISTICS
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import SceneObject
from bsg_data.sources.annotation_files import decode, fetch_listed, malformed
from bsg_data.sources.assembly import assemble
from bsg_data.sources.hm3d import MATTERPORT
from bsg_data.sources.hm3d_names import keep_one_copy, split_by_number, version_of
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SourceRow

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

    def __init__(self, path: AnyPath) -> None:
        object.__setattr__(self, "path", Path(path))

    @property
    def kind(self) -> str:
        """`hm3d-stats`."""
        return "hm3d-stats"

    @property
    def options(self) -> dict[str, int | str]:
        """No options."""
        return {}

    def find(self) -> FoundScenes:
        """List the scenes of the zip."""
        refs = [
            SceneRef(
                scene_id=scene_id,
                location=scene_id,
                fingerprint=_digest_scene_lines(lines),
                source_split=split_by_number(scene_id),
                source_version=version_of(self.path.name),
            )
            for scene_id, lines in self._lines.items()
        ]
        if not refs:
            raise SourceError(
                f"{self.path}: the table of regions has no row",
                code="source-empty",
                where=self.path,
            )
        return keep_one_copy(refs)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene from its rows."""
        lines = fetch_listed(ref, self.path, lambda: self._lines[ref.location], _digest_scene_lines)
        graph = assemble(
            parse_scene_lines(lines, path=self.path),
            ref=ref,
            kind=self.kind,
            sha256=ref.fingerprint,
            class_map=class_map,
        )
        return Reading(graph)

    @cached_property
    def _lines(self) -> dict[str, list[tuple[int, str]]]:
        return read_scene_lines(self.path)

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling without the table; a worker reads it again."""
        return type(self), (self.path,)


def read_scene_lines(path: Path) -> dict[str, list[tuple[int, str]]]:
    """Read the statistics as numbered lines by scene, scenes sorted by id."""
    scenes: dict[str, list[tuple[int, str]]] = {}
    lines = _read_member(path)
    header = next(lines, "")
    if tuple(header.split(",")[: len(HEADER)]) != HEADER:
        raise malformed(path / MEMBER, 1, header, expected=",".join(HEADER))
    for number, line in enumerate(lines, start=2):
        if line.strip():
            scenes.setdefault(line.split(",", 1)[0], []).append((number, line))
    return dict(sorted(scenes.items()))


def parse_scene_lines(lines: list[tuple[int, str]], *, path: Path) -> tuple[SceneObject, ...]:
    """Parse the lines of one scene into objects sorted by id, with their region ids."""
    objects: dict[int, SceneObject] = {}
    regions: set[int] = set()
    for number, line in lines:
        for obj in _parse_region(line, path, number, regions):
            if obj.instance_id in objects:
                expected = "an instance id that no earlier region of the scene has"
                name = f"{obj.raw_category}_{obj.instance_id}"
                raise malformed(path / MEMBER, number, name, expected=expected)
            objects[obj.instance_id] = obj
    return tuple(objects[key] for key in sorted(objects))


def _digest_scene_lines(lines: list[tuple[int, str]]) -> str:
    """Return the sha256 of the lines of one scene, joined by line feeds."""
    return hashlib.sha256("\n".join(line for _, line in lines).encode()).hexdigest()


def _parse_region(line: str, path: Path, number: int, seen: set[int]) -> Iterator[SceneObject]:
    def fault(text: str, expected: str) -> AnnotationError:
        return malformed(path / MEMBER, number, text, expected=expected)

    try:
        row = next(csv.reader([line], strict=True))
    except csv.Error as error:
        raise fault(line, f"a row of comma separated values ({error})") from error
    if len(row) != len(HEADER) or not _WHOLE.fullmatch(row[1]) or not _WHOLE.fullmatch(row[3]):
        raise fault(line, f"{','.join(HEADER)}, with whole numbers as region and # Objects")
    region, count = int(row[1]), int(row[3])
    if region in seen:
        raise fault(line, f"region {region} of this scene once")
    seen.add(region)
    tokens = row[4].split(":") if row[4] else []
    if len(tokens) != count:
        raise fault(line, f"{count} instances as the row says ({len(tokens)} are listed)")
    for token in tokens:
        match = _TOKEN.fullmatch(token)
        if match is None:
            raise fault(token, "<name>_<instance id>")
        yield SceneObject(0, int(match[2]), region, match[1])


def _read_member(path: Path) -> Iterator[str]:
    """Return the lines of the table, without the line feeds at their ends."""
    text = decode(read_member(path, MEMBER, STATISTICS), path=path / MEMBER)
    return iter(text.replace("\r\n", "\n").split("\n"))


ROW = SourceRow(
    summary="the public zip of HM3DSem's statistics: corrected names, no meshes",
    open=HM3DStatistics,
    terms=MATTERPORT,
)
