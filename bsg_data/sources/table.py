"""Read a user's own buildings from a table of objects, CSV or parquet.

Each row is an object with `scene`, `room`, `category` and optional columns. An object without a
room belongs to the building. A row without a category describes an empty room.
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, ClassVar

import numpy as np
from pydantic import BaseModel, BeforeValidator, ConfigDict, Field, ValidationError, model_validator

from bsg_data.errors import SourceError
from bsg_data.geometry.placement import find_storeys
from bsg_data.inputs.bounded_file import open_stream
from bsg_data.inputs.bounds import MAX_LINE, MAX_OBJECT_ROWS, TABLE
from bsg_data.inputs.parquet import open_parquet_file, refusing_damage
from bsg_data.recipes import name_fault
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import Box, Point, Room, SceneObject, is_scene_id
from bsg_data.sources.annotation_files import fetch_listed, keep_one_copy, state_of
from bsg_data.sources.assembly import assemble, place_room
from bsg_data.sources.source import (
    LICENCE_REF,
    FoundScenes,
    Reading,
    SceneRef,
    SkippedScene,
    SourceRow,
    Terms,
)
from bsg_data.spelling import ask_if_meant

_SUFFIXES = (".csv", ".csv.gz", ".tsv", ".tsv.gz", ".parquet")
_REQUIRED = ("scene", "room", "category")
_FACTS = ("room_label", "floor", "floor_area")  # of a room
_CENTROID = ("x", "y", "z")
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in _CENTROID)
_NUMBER = re.compile(r"[0-9]{1,9}")
_DIGITS = re.compile(r"([0-9]+)")
_SLACK = 1e-4  # metres that a centroid may stand outside its box: files round


def _as_text(value: Any) -> Any:
    """Return a cell as text: pandas gives whole numbers as floats where one is missing."""
    if isinstance(value, float) and value.is_integer():
        value = int(value)
    return str(value).strip() if isinstance(value, str | int | float) else value


def _as_names(value: Any) -> Any:
    names = value.split(";") if isinstance(value, str) else value
    names = names if isinstance(names, list) else [_as_text(names)]
    return sorted(filter(None, (_as_text(name) for name in names if name is not None)))


# The longest name of HM3D has 61 characters.
_Name = Annotated[str, BeforeValidator(_as_text), Field(max_length=200)]
_Metres = Annotated[float, Field(ge=-10_000, le=10_000)]


class _TableRow(BaseModel):
    """One row of a table: an object, or a room alone."""

    model_config = ConfigDict(extra="ignore", frozen=True)

    scene: _Name  # the name of its building
    room: _Name = ""  # the name of its room; empty for an object of the building
    category: _Name = ""  # the name of the object; empty for a room alone
    room_label: _Name | None = None  # what the room is, e.g. `kitchen`.
    # the level of the room, counted as one likes
    floor: Annotated[int, Field(ge=-1000, le=1000)] | None = None
    floor_area: Annotated[float, Field(gt=0, le=1e7)] | None = None  # of the room, square metres
    # names of rooms that connect to the room
    connected: Annotated[tuple[_Name, ...], BeforeValidator(_as_names)] = ()
    # where the object is, and its box; metres, Z up
    x: _Metres | None = None
    y: _Metres | None = None
    z: _Metres | None = None
    box_min_x: _Metres | None = None
    box_min_y: _Metres | None = None
    box_min_z: _Metres | None = None
    box_max_x: _Metres | None = None
    box_max_y: _Metres | None = None
    box_max_z: _Metres | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> _TableRow:
        given = self.model_fields_set
        if not is_scene_id(self.scene):
            raise ValueError(f"scene: expected a name that a file can have, found {self.scene!r}")
        if not self.room and not self.category:
            raise ValueError("category: expected an object, or a room in the column room")
        if not self.room and given & {*_FACTS, "connected"}:
            raise ValueError("room: expected the room that the row describes, found none")
        for group in (_CENTROID, _BOX):
            if 0 < len(given.intersection(group)) < len(group):
                absent = next(name for name in group if name not in given)
                raise ValueError(f"{absent}: expected a number, as in the rest of {group}")
            if not self.category and given.intersection(group):
                raise ValueError(f"category: expected the object that is at {group[0]}")
        box = self.box or Box((-math.inf,) * 3, (math.inf,) * 3)
        for axis, low, high in zip(_CENTROID, box.minimum, box.maximum, strict=True):
            if low > high:
                raise ValueError(f"box_max_{axis}: expected {low} or more, found {high}")
            value = getattr(self, axis)
            if value is not None and not low - _SLACK <= value <= high + _SLACK:
                raise ValueError(f"{axis}: expected {low} to {high}, its box; found {value}")
        return self

    @property
    def centroid(self) -> Point | None:
        x, y, z = self.x, self.y, self.z
        if x is None or y is None or z is None:
            return self.box.centre if self.box else None
        return x, y, z

    @property
    def box(self) -> Box | None:
        if self.box_min_x is None:
            return None
        a, b, c, d, e, f = (getattr(self, name) for name in _BOX)
        return Box((a, b, c), (d, e, f))

    @property
    def key(self) -> tuple[Any, ...]:
        """What the row says, in an order of its own."""
        box = (*self.box.minimum, *self.box.maximum) if self.box else ()
        point = () if self.x is None else (self.x, self.y, self.z)
        return (
            (self.room, self.category, point, box),
            (self.room_label or "", str(self.floor), str(self.floor_area), self.connected),
        )


_OPTIONAL = tuple(name for name in _TableRow.model_fields if name not in _REQUIRED)
_Facts = dict[str, dict[str, Any]]  # room → what some row says of it, a column of `_FACTS` each
_Scene = tuple[list[_TableRow], _Facts]  # the rows by their keys


@dataclass(frozen=True)
class ObjectTable:
    """A table of objects, CSV (`.csv`, `.tsv`, gzip too) or parquet."""

    path: Path
    licence: str | None = None  # SPDX identifier
    licence_url: str | None = None  # SPDX's own page if it is not given
    homepage: str | None = None
    citation: str | None = None

    kind = "table"
    options: ClassVar[dict[str, int | str]] = {}

    def __post_init__(self) -> None:
        _ = self.terms  # refuse what would spoil a card before anything is built

    @property
    def terms(self) -> Terms | None:
        """The terms that the user gave; None where nobody said any."""
        licence, homepage, citation = self.licence, self.homepage, self.citation
        if not any((licence, homepage, citation, self.licence_url)):
            return None
        if licence is None or homepage is None or citation is None:
            said = "give licence, homepage and citation, or no terms if the licence is unknown"
        elif self.licence_url is None and licence.startswith(LICENCE_REF):
            said = f"licence {licence}: give licence_url, too: SPDX has no page of it"
        else:
            return Terms(
                licence=licence,
                licence_url=self.licence_url or f"https://spdx.org/licenses/{licence}.html",
                homepage=homepage,
                citation=citation,
                sentence=f"The data are under the licence {licence}, as {homepage} says.",
            )
        message = f"the terms of {self.path}: {said}"
        raise SourceError(message, code="terms-missing", where=self.path)

    def find(self) -> FoundScenes:
        """Find the scenes of the table; columns that are not read are listed as left out."""
        scenes, unread = self._read()
        found = keep_one_copy(SceneRef(name, name, _digest(one)) for name, one in scenes.items())
        if not unread:
            return found
        asked = {column: ask_if_meant(column, _OPTIONAL) for column in unread}
        named = [f"{column} ({hint})" if hint else column for column, hint in asked.items()]
        skip = SkippedScene("all", self.path.name, f"columns that are not read: {', '.join(named)}")
        return replace(found, unused=(skip,))

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; the order of its rows does not matter."""
        rows, facts = fetch_listed(ref, self.path, lambda: self._read()[0][ref.scene_id], _digest)
        regions = number_rooms(facts)
        placed = [(regions.get(row.room, -1), row) for row in rows if row.category]
        placed.sort(key=lambda pair: (pair[0], pair[1].key))
        objects = [
            SceneObject(0, number, region, row.category, centroid=row.centroid, box=row.box)
            for number, (region, row) in enumerate(placed, start=1)
        ]
        graph = assemble(
            objects,
            ref=ref,
            kind=self.kind,
            class_map=class_map,
            rooms=_describe_rooms(rows, facts, regions),
            doors=[(regions[row.room], regions[other]) for row in rows for other in row.connected],
        )
        return Reading(graph)

    def _read(self) -> tuple[Mapping[str, _Scene], Sequence[str]]:
        return _read_table(self.path, *state_of(self.path))


@lru_cache(maxsize=1)
def _read_table(path: Path, size: int, changed: int) -> tuple[Mapping[str, _Scene], Sequence[str]]:
    """Read the scenes and the columns that are not read, once for each state of the file."""
    name = path.name.casefold()
    if not name.endswith(_SUFFIXES):
        expected = f"a file that ends in {', '.join(_SUFFIXES)}"
        raise SourceError(f"{path}: expected {expected}", code="table-suffix", where=path)
    lines = _read_parquet(path) if name.endswith(".parquet") else _read_csv(path)
    columns = [str(column).strip() for column in next(lines, ("", []))[1]]
    _require_columns(path, columns)
    scenes: dict[str, list[tuple[_TableRow, str]]] = {}
    for count, (line, cells) in enumerate(lines):
        if count >= MAX_OBJECT_ROWS:
            message = f"{path}: over {MAX_OBJECT_ROWS:,} rows; split it into several tables"
            raise SourceError(message, code="table-too-long", where=path)
        row = _parse_row(f"{path}, {line}", columns, cells)
        scenes.setdefault(row.scene, []).append((row, line))
    if not scenes:
        message = f"{path}: no row; expected an object a row"
        raise SourceError(message, code="source-empty", where=path)
    unread = [column for column in columns if column not in _TableRow.model_fields]
    found = {}
    for scene, rows in scenes.items():
        facts = _gather_facts(rows, f"{path}: scene {scene}")
        found[scene] = (sorted((row for row, _ in rows), key=lambda row: row.key), facts)
    return found, unread


def _read_csv(path: Path) -> Iterator[tuple[str, list[Any]]]:
    """Yield the header, then the place and the fields of every line that is not empty.

    The csv module knows the line of a fault, also where a field has several; pandas does not.
    """
    number = 0

    def refuse(said: str, **place: Any) -> SourceError:
        after = f", after line {number}" if number else ""
        return SourceError(f"{path}{after}{said.removeprefix(str(path))}", **place)

    separator = "\t" if ".tsv" in path.name.casefold() else ","
    try:
        with open_stream(path, TABLE, error=refuse) as opened:
            text = io.TextIOWrapper(opened, encoding="utf-8-sig", newline="")
            lines = iter(lambda: text.readline(MAX_LINE), "")
            for fields in (reader := csv.reader(lines, strict=True, delimiter=separator)):
                number = reader.line_num
                if any(field.strip() for field in fields):
                    yield f"line {number}", fields
    except (UnicodeDecodeError, csv.Error) as error:
        said = f": no text in columns ({error})"
        raise refuse(said, code="csv-malformed", where=path) from error


def _read_parquet(path: Path) -> Iterator[tuple[str, list[Any]]]:
    """Yield the names of the columns, then the place and the values of every row."""
    with open_parquet_file(path, most=MAX_OBJECT_ROWS) as file, refusing_damage(path):
        names = file.schema_arrow.names
        yield "", names
        known = [name for name in names if name in _TableRow.model_fields]
        rows = chain.from_iterable(b.to_pylist() for b in file.iter_batches(columns=known))
        for number, row in enumerate(rows, start=1):
            yield f"row {number}", [row.get(name) for name in names]


def _parse_row(where: str, columns: Sequence[str], cells: Sequence[Any]) -> _TableRow:
    if len(cells) != len(columns):
        message = f"{where}: expected {len(columns)} fields, as the header; found {len(cells)}"
        raise SourceError(message, code="row-ragged", where=where)
    given = {name: cell for name, cell in zip(columns, cells, strict=True) if not _is_empty(cell)}
    try:
        return _TableRow.model_validate({"scene": "", **given})
    except ValidationError as error:
        fault = name_fault(error)
        whole = fault.removeprefix("the whole file: ")  # of a rule for the row
        message = f"{where}: {whole}" if whole != fault else f"{where}, column {fault}"
        raise SourceError(message, code="row-malformed", where=where) from error


def _is_empty(cell: Any) -> bool:
    return cell is None or cell in ("", []) or not str(cell).strip() or cell != cell


def _require_columns(path: Path, columns: Sequence[str]) -> None:
    twice = [column for number, column in enumerate(columns) if column in columns[:number]]
    if twice:
        raise SourceError(f"{path}: the column {twice[0]!r} twice", code="column-twice", where=path)
    groups = [group for group in (_CENTROID, _BOX) if set(group) & set(columns)]
    wanted = [*_REQUIRED, *(name for group in groups for name in group)]
    missing = next((name for name in wanted if name not in columns), None)
    if missing:
        hint = ask_if_meant(missing, columns)
        if len(columns) == 1 and ";" in columns[0]:
            hint = "save it with commas, or with tabs as .tsv"
        raise SourceError(
            f"{path}: no column {missing!r}{hint and f'; {hint}'}. Expected "
            f"{', '.join(_REQUIRED)}, in small letters, and any of {', '.join(_OPTIONAL)}; found "
            f"{', '.join(columns) or 'none'}",
            code="column-missing",
            where=path,
        )


def _gather_facts(rows: Sequence[tuple[_TableRow, str]], where: str) -> _Facts:
    """Return what the rows of a scene say of its rooms; refuse rows that disagree."""
    facts: _Facts = {row.room: {} for row, _ in rows if row.room}
    for row, line in rows:
        place = f"{where}, {line}"
        said = {name: value for name in _FACTS if (value := getattr(row, name)) is not None}
        for name, value in said.items():
            known = facts[row.room].setdefault(name, value)
            if value != known:
                raise SourceError(
                    f"{place}, column {name}: expected {known!r} for room {row.room!r}, as an "
                    f"earlier one says; found {value!r}",
                    code="rows-disagree",
                    where=place,
                )
        for other in row.connected:
            if other not in facts or other == row.room:
                raise SourceError(
                    f"{place}, column connected: expected names of other rooms with ; between "
                    f"them; found {other!r}. A room without objects is a row without a category",
                    code="room-unknown",
                    where=place,
                )
    return facts


def number_rooms(names: Iterable[str]) -> dict[str, int]:
    """Return the region id of every room: its name where all are numbers, else its place by name.

    >>> number_rooms(["7", "3"]), number_rooms(["room 10", "room 9"])
    ({'3': 3, '7': 7}, {'room 9': 0, 'room 10': 1})
    """
    ordered = sorted(names, key=_by_digits)
    if ordered and all(map(_NUMBER.fullmatch, ordered)):
        numbers = {name: int(name) for name in ordered}
        if len(set(numbers.values())) == len(numbers):
            return numbers
    return {name: place for place, name in enumerate(ordered)}


def _by_digits(name: str) -> tuple[list[Any], str]:
    """Order names as people do: `room 9` before `room 10`."""
    parts = _DIGITS.split(name)  # text and numbers in turn, text first
    return [int(part) if place % 2 else part for place, part in enumerate(parts)], name


def _describe_rooms(
    rows: Sequence[_TableRow], facts: _Facts, regions: Mapping[str, int]
) -> list[Room]:
    """Return what the rows tell of the rooms; their levels, or those that their floors show."""
    points: dict[str, list[Point]] = {name: [] for name in facts}
    boxed = {row.room for row in rows if row.box}
    for row in rows:
        if row.room and row.centroid:
            ends = (row.box.minimum, row.box.maximum) if row.box else ()
            points[row.room] += [row.centroid, *ends]
    rooms = []
    for name, said in facts.items():
        label = said.get("room_label") or (None if _NUMBER.fullmatch(name) else name)
        room = Room(0, regions[name], label, floor_area=said.get("floor_area"))
        if points[name]:
            around = Box.around(np.array(points[name]))
            is_boxed = name in boxed  # else its objects are points, and it has a middle alone
            room = place_room(room, around) if is_boxed else replace(room, centroid=around.centre)
        rooms.append(room)
    floors = [said.get("floor") for said in facts.values()]
    levels = sorted({floor for floor in floors if floor is not None})
    if not levels:
        return list(find_storeys(rooms))
    return [
        replace(room, floor_index=None if floor is None else levels.index(floor))
        for room, floor in zip(rooms, floors, strict=True)
    ]


def _digest(scene: _Scene) -> str:
    """Hash what the rows of a scene say, in whatever order they stand."""
    said = sorted(repr(row.key) for row in scene[0])
    return hashlib.sha256("\n".join(said).encode("utf-8", "surrogatepass")).hexdigest()


ROW = SourceRow(summary="a table of your own objects, CSV or parquet", open=ObjectTable, terms=None)
