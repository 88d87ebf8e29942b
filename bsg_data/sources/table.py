"""Read a user's own buildings from a table of objects, CSV or parquet.

Each row is an object, or `count` equal ones, with `scene`, `room`, `category` and optional columns.
An object without a room belongs to the building. A row without a category describes an empty room.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, replace
from itertools import chain, repeat
from pathlib import Path
from typing import Any

import numpy as np

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.errors import SourceError
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.sources.annotation_files import keep_one_copy, skip_columns
from bsg_data.sources.assembly import assemble
from bsg_data.sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    SourceRow,
)
from bsg_data.sources.table_rows import FIELDS, Facts, Row, Scene, read_scenes
from bsg_data.terms import LICENCE_REF, Terms

_NUMBER = re.compile(r"[0-9]{1,9}")
_DIGITS = re.compile(r"([0-9]+)")


@dataclass(frozen=True)
class _ObjectTable:
    """A table of objects, CSV (`.csv`, `.tsv`, gzip too) or parquet."""

    path: Path
    _: KW_ONLY
    licence: str | None = None  # SPDX identifier
    licence_url: str | None = None  # SPDX's own page if it is not given
    homepage: str | None = None
    citation: str | None = None
    # the column of the file that is read as one of `FIELDS`; None: the one of this name
    scene: str | None = None
    room: str | None = None
    category: str | None = None
    count: str | None = None
    room_label: str | None = None
    floor: str | None = None
    floor_area: str | None = None
    connected: str | None = None
    x: str | None = None
    y: str | None = None
    z: str | None = None
    box_min_x: str | None = None
    box_min_y: str | None = None
    box_min_z: str | None = None
    box_max_x: str | None = None
    box_max_y: str | None = None
    box_max_z: str | None = None

    kind = "table"

    def __post_init__(self) -> None:
        _ = self.terms  # refuse what would spoil a card before anything is built

    @property
    def options(self) -> dict[str, int | str]:
        """The names of columns that the user gave."""
        return {name: column for name in FIELDS if (column := getattr(self, name)) is not None}

    @property
    def terms(self) -> Terms | None:
        """The terms that the user gave; None where nobody said any."""
        licence, homepage, citation = self.licence, self.homepage, self.citation
        if not any((licence, homepage, citation, self.licence_url)):
            return None
        if licence is None or homepage is None or citation is None:
            fault = "give licence, homepage and citation, or no terms if the licence is unknown"
        elif self.licence_url is None and licence.startswith(LICENCE_REF):
            fault = f"licence {licence}: give licence_url, too: SPDX has no page of it"
        else:
            return Terms(
                licence=licence,
                licence_url=self.licence_url or f"https://spdx.org/licenses/{licence}.html",
                homepage=homepage,
                citation=citation,
                sentence=f"The data are under the licence {licence}, as {homepage} says.",
            )
        message = f"the terms of {self.path}: {fault}"
        raise SourceError(message, code="terms-missing", where=self.path)

    def find(self) -> FoundScenes:
        """Find the scenes of the table, and what of it is not read."""
        scenes, unread, left_out = read_scenes(self.path, tuple(self.options.items()))
        refs = [SceneRef(name, name, _digest(scene)) for name, scene in scenes.items()]
        found = keep_one_copy(refs, path=self.path, expected="no row; expected an object a row")
        notes = (
            SkippedScene("all", self.path.name, f"{what}: {times:,}")
            for what, times in sorted(left_out.items())
            if times
        )
        return replace(found, unused=(*skip_columns(self.path, unread), *notes))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; the order of its rows does not matter."""
        named = tuple(self.options.items())
        rows, facts = read_scenes(self.path, named)[0][ref.scene_id]
        regions = _number_rooms(facts)
        listed = [(regions.get(row.room, -1), row) for row in rows if row.category]
        listed.sort(key=lambda pair: (pair[0], pair[1].key))
        each = [pair for pair in listed for _ in range(pair[1].times)]
        annotation = Annotation(
            [region for region, _ in each],
            [row.category for _, row in each],
            centroids=[row.place for _, row in each],
            boxes=[row.box for _, row in each],
            rooms=_describe_rooms(rows, facts, regions),
            doors=[(regions[row.room], regions[other]) for row in rows for other in row.connected],
        )
        return Reading(assemble(annotation, ref=ref, kind=self.kind, class_map=class_map))


def _number_rooms(names: Iterable[str]) -> dict[str, int]:
    """Return the region id of every room: its name where all are numbers, else its number by name.

    >>> _number_rooms(["7", "3"]), _number_rooms(["room 10", "room 9"])
    ({'3': 3, '7': 7}, {'room 9': 0, 'room 10': 1})
    """
    ordered = sorted(names, key=_by_digits)
    if ordered and all(map(_NUMBER.fullmatch, ordered)):
        numbers = {name: int(name) for name in ordered}
        if len(set(numbers.values())) == len(numbers):
            return numbers
    return {name: number for number, name in enumerate(ordered)}


def _by_digits(name: str) -> tuple[list[Any], str]:
    """Order names as people do: `room 9` before `room 10`."""
    pieces = _DIGITS.split(name)  # text and numbers in turn, text first
    return [int(piece) if turn % 2 else piece for turn, piece in enumerate(pieces)], name


def _describe_rooms(
    rows: Sequence[Row], facts: Facts, regions: Mapping[str, int]
) -> Iterator[AnnotatedRoom]:
    """Yield what the rows tell of the rooms; their levels, or those that their floors show."""
    points: dict[str, list[Point]] = {name: [] for name in facts}
    boxed = {row.room for row in rows if row.box}
    for row in rows:
        if row.room and row.place:
            ends = (row.box.minimum, row.box.maximum) if row.box else ()
            points[row.room] += [row.place, *ends]
    levels = sorted({known["floor"] for known in facts.values() if known.get("floor") is not None})
    for name, known in facts.items():
        around = Box.around(np.array(points[name])) if points[name] else None
        is_boxed = name in boxed  # else its objects are points, and it has a middle alone
        floor = known.get("floor")
        yield AnnotatedRoom(
            region=regions[name],
            source_label=known.get("room_label") or (None if _NUMBER.fullmatch(name) else name),
            box=around if is_boxed else None,
            centroid=around.centre if around else None,
            floor_area=known.get("floor_area"),
            floor_index=None if floor is None else levels.index(floor),
        )


def _digest(scene: Scene) -> str:
    """Hash what the rows of a scene say, in whatever order they stand; n objects are n rows."""
    counts = sorted((repr(row.key), row.times) for row in scene[0])
    lines = "\n".join(chain.from_iterable(repeat(line, times) for line, times in counts))
    return hashlib.sha256(lines.encode("utf-8", "surrogatepass")).hexdigest()


ROW = SourceRow(
    summary="a table of your own objects, CSV or parquet", open=_ObjectTable, terms=None
)
