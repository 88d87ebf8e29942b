"""Read the public statistics of HM3DSem: corrected name, scene and region of each instance.

There are no meshes. `HM3DSem-v0.2.zip` holds `Per_Scene_Region_Neighborhoods.csv`: one row per
region, with its instances as `<corrected name>_<instance id>`, joined by colons. The header has a
sixth name without a column.
"""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

from bsg_data.errors import AnnotationError, SourceChangedError, SourceError
from bsg_data.files import AnyPath
from bsg_data.inputs.archive import read_member
from bsg_data.inputs.bounds import STATISTICS
from bsg_data.scene.class_map import ClassMap
from bsg_data.sources.annotation_files import require_fingerprint
from bsg_data.sources.annotations import Annotation, Instance
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
                fingerprint=digest_scene_lines(lines),
                source_split=split_by_number(scene_id),
                source_version=version_of(self.path.name),
            )
            for scene_id, lines in self._lines.items()
        ]
        if not refs:
            raise SourceError(f"{self.path}: the table of regions has no row")
        return keep_one_copy(refs)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene from its rows."""
        try:
            lines = self._lines[ref.location]
        except (SourceError, KeyError) as error:  # it could be read when the scenes were listed
            raise SourceChangedError(f"{self.path}: scene {ref.location}: {error}") from error
        where = f"{self.path}: {ref.location}"
        require_fingerprint(where, digest_scene_lines(lines), ref.fingerprint)
        annotation = parse_scene_lines(lines, path=self.path)
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))

    @cached_property
    def _lines(self) -> dict[str, list[tuple[int, str]]]:
        return read_scene_lines(self.path)

    def __reduce__(self) -> tuple[object, ...]:
        """Support pickling without the table; a worker reads it again."""
        return type(self), (self.path,)


def read_scene_lines(path: Path) -> dict[str, list[tuple[int, str]]]:
    """Read the statistics as numbered lines by scene, scenes sorted by id.

    Raises:
        SourceError: if the zip or its member is missing, damaged, encrypted or far too large.
    """
    scenes: dict[str, list[tuple[int, str]]] = {}
    lines = _read_member(path)
    header = next(lines, "")
    if tuple(header.split(",")[: len(HEADER)]) != HEADER:
        raise AnnotationError(path / MEMBER, 1, header, expected=",".join(HEADER))
    for number, line in enumerate(lines, start=2):
        if line.strip():
            scenes.setdefault(line.split(",", 1)[0], []).append((number, line))
    return dict(sorted(scenes.items()))


def parse_scene_lines(lines: list[tuple[int, str]], *, path: Path) -> Annotation:
    """Parse the lines of one scene.

    Raises:
        AnnotationError: for the first malformed row, a count that disagrees with its instances,
            or a repeated id or region.
    """
    instances: dict[int, Instance] = {}
    regions: set[int] = set()
    for number, line in lines:
        for instance in _parse_region(line, path, number, regions):
            if instance.instance_id in instances:
                raise AnnotationError(
                    path / MEMBER,
                    number,
                    f"{instance.name}_{instance.instance_id}",
                    expected="an instance id that no earlier region of the scene has",
                )
            instances[instance.instance_id] = instance
    ordered = tuple(instances[key] for key in sorted(instances))
    return Annotation(ordered, digest_scene_lines(lines))


def digest_scene_lines(lines: list[tuple[int, str]]) -> str:
    """Return the sha256 of the lines of one scene, joined by line feeds."""
    return hashlib.sha256("\n".join(line for _, line in lines).encode()).hexdigest()


def _parse_region(line: str, path: Path, number: int, seen: set[int]) -> Iterator[Instance]:
    def malformed(text: str, expected: str) -> AnnotationError:
        return AnnotationError(path / MEMBER, number, text, expected=expected)

    try:
        row = next(csv.reader([line], strict=True))
    except csv.Error as error:
        raise malformed(line, f"a row of comma separated values ({error})") from error
    if len(row) != len(HEADER) or not _WHOLE.fullmatch(row[1]) or not _WHOLE.fullmatch(row[3]):
        raise malformed(line, f"{','.join(HEADER)}, with whole numbers as region and # Objects")
    region, count = int(row[1]), int(row[3])
    if region in seen:
        raise malformed(line, f"region {region} of this scene once")
    seen.add(region)
    tokens = row[4].split(":") if row[4] else []
    if len(tokens) != count:
        raise malformed(line, f"{count} instances as the row says ({len(tokens)} are listed)")
    for token in tokens:
        match = _TOKEN.fullmatch(token)
        if match is None:
            raise malformed(token, "<name>_<instance id>")
        yield Instance(int(match[2]), match[1], region)


def _read_member(path: Path) -> Iterator[str]:
    """Yield the lines of the table, without the line feeds at their ends."""
    data = read_member(path, MEMBER, STATISTICS)
    try:
        for line in io.TextIOWrapper(io.BytesIO(data), encoding="utf-8-sig"):
            yield line.removesuffix("\n")
    except UnicodeDecodeError as error:
        raise SourceError(f"{path}: {MEMBER} is not UTF-8 (byte {error.start})") from error


ROW = SourceRow(
    summary="the public zip of HM3DSem's statistics: corrected names, no meshes",
    open=HM3DStatistics,
    terms=MATTERPORT,
)
