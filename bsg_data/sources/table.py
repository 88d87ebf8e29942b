"""Read a user's own buildings from a table of objects, CSV or parquet.

Each row is an object, or `count` equal ones, with `scene`, `room`, `category` and optional columns.
An object without a room belongs to the building. A row without a category describes an empty room.

Every cell is cleaned once, by `_clean`. Then buildings, and the rooms of each, get one name for all
spellings of it, by `_settle`.
"""

from __future__ import annotations

import csv
import hashlib
import io
import math
import re
import unicodedata
from collections import Counter
from collections.abc import Container, Iterable, Iterator, Mapping, Sequence
from dataclasses import KW_ONLY, dataclass, fields, replace
from decimal import Decimal
from functools import lru_cache
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, BinaryIO

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from pydantic import (
    AfterValidator,
    BeforeValidator,
    Field,
    TypeAdapter,
    ValidationError,
    model_validator,
)
from pydantic.dataclasses import dataclass as checked_dataclass

from bsg_data.dataset.manifest import LICENCE_REF, SkippedScene, Terms
from bsg_data.errors import SourceError
from bsg_data.first_fault import Metres
from bsg_data.geometry.placement import find_storeys
from bsg_data.inputs.bounded_file import open_stream
from bsg_data.inputs.bounds import MAX_CELL, MAX_LINE, MAX_OBJECT_ROWS, TABLE
from bsg_data.inputs.parquet import open_parquet_file, refusing_damage
from bsg_data.recipes import name_fault
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import AnnotatedObject, Box, Point, Room, is_scene_id
from bsg_data.sources.annotation_files import fetch_listed, keep_one_copy, state_of
from bsg_data.sources.assembly import assemble, place_room, require_few_letters
from bsg_data.sources.label_table import SUFFIXES, hint_separator, separator_of
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SourceRow
from bsg_data.words.nearest import ask_if_meant, nearest_names
from bsg_data.words.shown import list_some

_SUFFIXES = (*SUFFIXES, ".parquet")
_REQUIRED = ("scene", "room", "category")
_FACTS = ("room_label", "floor", "floor_area")  # of a room
_CENTROID = ("x", "y", "z")
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in _CENTROID)
_NUMBER = re.compile(r"[0-9]{1,9}")
_DIGITS = re.compile(r"([0-9]+)")
_WHOLE = re.compile(r"-?[0-9]+(\.0+)?")  # pandas writes 3.0 for 3 where a column has gaps
_SLACK = 1e-4  # metres that a centroid may stand outside its box: files round
_ROWS = 32  # that are decoded at a time, however long their words are
_LONGEST = 200  # characters of a name; the longest of HM3D has 61
_MOST = 100_000  # objects of a row
_NAMED = 5  # things in a note; the others are counted
_SHOWN = 20  # columns in an error or a note
# What `pandas.read_csv` takes for missing, and pandas' missing time.
_MISSING = {
    *("", "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "1.#IND", "1.#QNAN"),
    *("<NA>", "N/A", "NA", "NULL", "NaN", "NaT", "None", "n/a", "nan", "null"),
}
_NO_TEXT = re.compile("[\0\udc80-\udcff]")  # a surrogate stands for a byte that is no UTF-8
_BYTES = (pa.types.is_binary, pa.types.is_large_binary, pa.types.is_fixed_size_binary)
_TEXTS = (pa.types.is_string, pa.types.is_large_string, pa.types.is_string_view)
_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\u2028\u2029]")


def _as_name(value: Any) -> Any:
    """Return a cell as a name: other formats than CSV have numbers in columns of names."""
    name = str(value) if isinstance(value, str | int | float | Decimal) else value
    if isinstance(name, str) and len(name) > _LONGEST:
        raise ValueError(f"expected a name of at most {_LONGEST} characters, found {len(name):,}")
    if isinstance(name, str) and _CONTROL.search(name):
        raise ValueError(f"expected a name on one line, without control characters; found {name!r}")
    return name


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list | tuple) else [value]


def _sorted(names: tuple[str, ...]) -> tuple[str, ...]:
    return tuple(sorted(names))


_Name = Annotated[str, BeforeValidator(_as_name)]
_Names = Annotated[tuple[_Name, ...], BeforeValidator(_as_list), AfterValidator(_sorted)]


@checked_dataclass(frozen=True, slots=True)  # a model would take four times the memory
class _TableRow:
    """One row of a table: an object, equal objects, or a room alone."""

    scene: _Name  # the name of its building
    room: _Name = ""  # the name of its room; empty for an object of the building
    category: _Name = ""  # the name of the object; empty for a room alone
    # how many such objects there are; None: one
    count: Annotated[int, Field(ge=0, le=_MOST)] | None = None
    room_label: _Name | None = None  # what the room is, e.g. `kitchen`.
    # the level of the room, counted as one likes
    floor: Annotated[int, Field(ge=-1000, le=1000)] | None = None
    floor_area: Annotated[float, Field(gt=0, le=1e7)] | None = None  # of the room, square metres
    # names of rooms that connect to the room
    connected: _Names = ()
    # where the object is, and its box; metres, Z up
    x: Metres | None = None
    y: Metres | None = None
    z: Metres | None = None
    box_min_x: Metres | None = None
    box_min_y: Metres | None = None
    box_min_z: Metres | None = None
    box_max_x: Metres | None = None
    box_max_y: Metres | None = None
    box_max_z: Metres | None = None

    @model_validator(mode="after")
    def _fits_together(self) -> _TableRow:
        for fault in self._find_faults():
            raise ValueError(fault)
        return self

    def _find_faults(self) -> Iterator[str]:
        if not self.scene:
            yield "scene: expected the name of a building, found none"
        if not is_scene_id(self.scene):
            yield f"scene: expected a name that a file can have, found {self.scene!r}"
        if not self.room and not self.category:
            yield "category: expected an object, or a room in the column room"
        facts = (self.connected or None, self.room_label, self.floor, self.floor_area)
        if not self.room and any(fact is not None for fact in facts):
            yield "room: expected the room that the row describes, found none"
        if self.count and not self.category:
            yield f"count: expected none without a category, found {self.count}"
        for group in (_CENTROID, _BOX):
            yield from self._find_place_faults(group)
        box = self.box or Box((-math.inf,) * 3, (math.inf,) * 3)
        for axis, low, high in zip(_CENTROID, box.minimum, box.maximum, strict=True):
            if low > high:
                yield f"box_max_{axis}: expected {low} or more, found {high}"
            value = getattr(self, axis)
            if value is not None and not low - _SLACK <= value <= high + _SLACK:
                yield f"{axis}: expected {low} to {high}, its box; found {value}"

    def _find_place_faults(self, group: tuple[str, ...]) -> Iterator[str]:
        absent = [name for name in group if getattr(self, name) is None]
        if len(absent) == len(group):
            return
        if absent:
            yield f"{absent[0]}: expected a number, as in the rest of {group}"
        if not self.category:
            yield f"category: expected the object that is at {group[0]}"
        if self.count not in (None, 1):
            yield f"count: expected 1, as the object has a place; found {self.count}"

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
        """What the row says of one object, in an order of its own."""
        box = (*self.box.minimum, *self.box.maximum) if self.box else ()
        point = () if self.x is None else (self.x, self.y, self.z)
        return (
            (self.room, self.category, point, box),
            (self.room_label or "", str(self.floor), str(self.floor_area), self.connected),
        )


_FIELDS = tuple(field.name for field in fields(_TableRow))
_OPTIONAL = tuple(name for name in _FIELDS if name not in _REQUIRED)
_ROW = TypeAdapter(_TableRow)
_Facts = dict[str, dict[str, Any]]  # room → what some row says of it, a column of `_FACTS` each
_Scene = tuple[list[_TableRow], _Facts]  # the rows by their keys
_Listed = tuple[_TableRow, str]  # a row and its line


@dataclass(frozen=True)
class _ObjectTable:
    """A table of objects, CSV (`.csv`, `.tsv`, gzip too) or parquet."""

    path: Path
    _: KW_ONLY
    licence: str | None = None  # SPDX identifier
    licence_url: str | None = None  # SPDX's own page if it is not given
    homepage: str | None = None
    citation: str | None = None
    # the column of the file that is read as one of `_TableRow`; None: the one of this name
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
        return {name: column for name in _FIELDS if (column := getattr(self, name)) is not None}

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
        """Find the scenes of the table; what is not read as it stands is listed as left out."""
        scenes, notes = self._read()
        refs = [SceneRef(name, name, _digest(one)) for name, one in scenes.items()]
        found = keep_one_copy(refs, path=self.path, expected="no row; expected an object a row")
        return replace(
            found, unused=tuple(SkippedScene("all", self.path.name, note) for note in notes)
        )

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; the order of its rows does not matter."""
        rows, facts = fetch_listed(ref, self.path, lambda: self._read()[0][ref.scene_id], _digest)
        regions = _number_rooms(facts)
        listed = [(regions.get(row.room, -1), row) for row in rows if row.category]
        listed.sort(key=lambda pair: (pair[0], pair[1].key))
        each = (pair for pair in listed for _ in range(pair[1].count or 1))
        objects = [
            AnnotatedObject(number, region, row.category, centroid=row.centroid, box=row.box)
            for number, (region, row) in enumerate(each, start=1)
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
        return _read_table(self.path, *state_of(self.path), tuple(self.options.items()))


@lru_cache(maxsize=1)
def _read_table(
    path: Path, size: int, changed: int, named: tuple[tuple[str, str], ...]
) -> tuple[Mapping[str, _Scene], Sequence[str]]:
    """Read the scenes, and notes of what differs from the file, once for each state of it."""
    name = path.name.casefold()
    if not name.endswith(_SUFFIXES):
        expected = f"a file that ends in {', '.join(_SUFFIXES)}"
        raise SourceError(f"{path}: expected {expected}", code="table-suffix", where=path)
    is_parquet = name.endswith(".parquet")
    lines = _read_parquet(path, dict(named)) if is_parquet else _read_csv(path)
    header = [str(column).strip() for column in next(lines, ("", []))[1]]
    columns = _find_columns(path, header, dict(named))
    notes: Counter[str] = Counter()
    spelt = _read_rows(path, lines, header, columns, notes)
    names = _settle({spelling: len(rows) for spelling, rows in spelt.items()})
    scenes: dict[str, list[_Listed]] = {}
    for spelling, scene in names.items():
        scenes.setdefault(scene, []).extend(spelt.pop(spelling))
    found: dict[str, _Scene] = {}
    several: list[str] = []  # rooms
    for scene in sorted(scenes):
        rows, rooms = _settle_rooms(scenes.pop(scene))
        several += (f"{said} in {scene}" for said in _list_several(rooms))
        facts = _gather_facts(rows, f"{path}: scene {scene}")
        found[scene] = (sorted((row for row, _ in rows), key=lambda row: row.key), facts)
    said = [
        _note_unread(_list_unread(header, columns), columns),
        _note("buildings of several spellings, each read as one", _list_several(names)),
        _note("rooms of several spellings, each read as one", several),
        *(f"{what}: {times:,}" for what, times in sorted(notes.items())),
    ]
    return found, [note for note in said if note]


def _read_csv(path: Path) -> Iterator[tuple[str, Sequence[Any]]]:
    """Yield the header, then the line and the fields of every line that is not empty.

    The csv module knows the line of a fault, also where a field has several; pandas does not.
    """
    number = 0

    def refuse(said: str, **fault: Any) -> SourceError:
        after = f", after line {number}" if number else ""
        return SourceError(f"{path}{after}{said.removeprefix(str(path))}", **fault)

    try:
        with open_stream(path, TABLE, error=refuse) as opened:
            lines = _read_lines(path, opened)
            for fields in (reader := csv.reader(lines, strict=True, delimiter=separator_of(path))):
                number = reader.line_num
                if any(field.strip() for field in fields):
                    yield f"line {number}", fields
    except csv.Error as error:
        why = "a quote is not closed" if "end of data" in str(error) else error
        said = f": no text in columns ({why})"
        raise refuse(said, code="csv-malformed", where=path) from error


def _read_lines(path: Path, file: BinaryIO) -> Iterator[str]:
    """Yield the lines of UTF-8 text; the error names the first that is none."""
    text = io.TextIOWrapper(file, encoding="utf-8-sig", errors="surrogateescape", newline="")
    for number, line in enumerate(iter(lambda: text.readline(MAX_LINE), ""), start=1):
        if fault := _NO_TEXT.search(line):
            where = f"{path}, line {number}"
            around = line[max(fault.start() - 20, 0) : fault.end() + 20].strip()
            found = around.encode("utf-8", "surrogateescape")
            raise SourceError(
                f"{where}: expected UTF-8 text, found {found!r}; save the table as UTF-8 (Excel: "
                "CSV UTF-8)",
                code="csv-malformed",
                where=where,
            )
        yield line


def _read_parquet(path: Path, named: Mapping[str, str]) -> Iterator[tuple[str, Sequence[Any]]]:
    """Yield the names of the columns, then the line and the values of every row."""
    wanted = {_fold(name) for name in (*_FIELDS, *named.values())}

    def is_read(name: str) -> bool:
        return _fold(name) in wanted

    opened = open_parquet_file(path, most=MAX_OBJECT_ROWS, bound=TABLE, is_read=is_read)
    with opened as file, refusing_damage(path):
        for field in file.schema_arrow:  # runs of a list have any number of values
            kind = getattr(field.type, "storage_type", field.type)  # of an extension
            if is_read(field.name) and pa.types.is_nested(kind):
                message = (
                    f"{path}, column {field.name}: expected text, found lists; put ; between names"
                )
                raise SourceError(message, code="table-lists", where=path)
        names = file.schema_arrow.names
        yield "", names
        chosen = _find_columns(path, [name.strip() for name in names], named)
        known = [names[at] for at in chosen.values()]
        number, size = 0, 0
        for batch in file.iter_batches(_ROWS, columns=known):
            columns = {name: _plain(batch.column(name)) for name in known}
            where = f"{path}, row {number + 1} or soon after"
            _refuse_long_cells(where, columns)
            size += sum(column.nbytes for column in columns.values())
            if size > TABLE:
                message = f"{where}: over {TABLE:,} bytes; split it into several tables"
                raise SourceError(message, code="file-too-large", where=where)
            listed = {name: column.to_pylist() for name, column in columns.items()}
            blank = [None] * batch.num_rows
            for row in zip(*(listed.get(name, blank) for name in names), strict=True):
                number += 1
                yield f"row {number}", row


def _plain(column: pa.Array) -> pa.Array:
    """Return a column without dictionaries, and as text where a program wrote that as bytes."""
    if pa.types.is_dictionary(column.type):
        column = column.cast(column.type.value_type)
    if any(is_bytes(column.type) for is_bytes in _BYTES):
        column = column.cast(pa.binary()).cast(pa.string())
    return column


def _refuse_long_cells(where: str, columns: Mapping[str, pa.Array]) -> None:
    """Refuse cells before they become a text for every row."""
    for name, column in columns.items():
        if any(is_text(column.type) for is_text in _TEXTS):
            lengths = pc.binary_length(column.cast(pa.large_string()))
            longest = pc.max(lengths).as_py() or 0
            if longest > MAX_CELL:
                place = f"{where}, column {name}"
                message = f"{place}: expected at most {MAX_CELL:,} bytes, found {longest:,}"
                raise SourceError(message, code="cell-too-long", where=place)


def _find_columns(path: Path, header: Sequence[str], named: Mapping[str, str]) -> dict[str, int]:
    """Return field → number of its column, spelt as asked, else in other letters or spaces."""
    exact, alike = _index(header), _index(map(_fold, header))
    columns: dict[str, int] = {}
    for field in _FIELDS:
        asked = named.get(field, field).strip()
        found = exact.get(asked) or alike.get(_fold(asked), [])
        if len(found) > 1:
            spellings = {header[at] for at in found} - {asked}
            shown = f", as {list_some(sorted(spellings), _SHOWN)}" if spellings else ""
            message = f"{path}: the column {asked!r} twice{shown}"
            raise SourceError(message, code="column-twice", where=path)
        if found:
            columns[field] = found[0]
    groups = [group for group in (_CENTROID, _BOX) if set(group) & set(columns)]
    for field in (*named, *_REQUIRED, *chain.from_iterable(groups)):
        if field not in columns:
            raise _lack_column(path, field, named.get(field, field), header, columns)
    return columns


def _index(names: Iterable[str]) -> dict[str, list[int]]:
    numbers: dict[str, list[int]] = {}
    for number, name in enumerate(names):
        numbers.setdefault(name, []).append(number)
    return numbers


def _lack_column(
    path: Path, field: str, asked: str, header: Sequence[str], columns: Mapping[str, int]
) -> SourceError:
    near = nearest_names(asked, _list_unread(header, columns)[:_SHOWN], most=1)
    hint = f"name yours by --option {field}=COLUMN"
    if near:
        hint = f"did you mean {near[0]}? Then give --option {field}={near[0]}"
    hint = hint_separator(header) or hint
    return SourceError(
        f"{path}: no column {asked!r}{hint and f'; {hint}'}. Expected a header with "
        f"{', '.join(_REQUIRED)}, and any of {', '.join(_OPTIONAL)}; found "
        f"{list_some(header, _SHOWN) or 'none'}",
        code="column-missing",
        where=path,
    )


def _list_unread(header: Sequence[str], columns: Mapping[str, int]) -> list[str]:
    read = set(columns.values())
    return [name for number, name in enumerate(header) if number not in read]


def _read_rows(
    path: Path,
    lines: Iterable[tuple[str, Sequence[Any]]],
    header: Sequence[str],
    columns: Mapping[str, int],
    notes: Counter[str],
) -> dict[str, list[_Listed]]:
    """Return the rows of every spelling of a building; count cells and rows that say nothing."""
    spelt: dict[str, list[_Listed]] = {}
    objects = 0
    for line, cells in lines:
        where = f"{path}, {line}"
        if len(cells) != len(header):
            message = f"{where}: expected {len(header)} fields, as the header; found {len(cells)}"
            raise SourceError(message, code="row-ragged", where=where)
        if all(str(cells[at]).strip() == header[at] for at in columns.values()):  # tables joined
            notes["rows that repeat the header, left out"] += 1
            continue
        said = {field: _clean(cells[at], notes, field) for field, at in columns.items()}
        given = {field: value for field, value in said.items() if value is not None}
        if not given:  # spreadsheets have empty rows at their ends
            continue
        if given.keys() <= {"scene"}:
            notes["rows of a building alone, left out"] += 1
            continue
        row = _parse_row(where, given)
        objects += max(row.count or 1, len(row.connected))
        if objects > MAX_OBJECT_ROWS:
            message = (
                f"{path}: over {MAX_OBJECT_ROWS:,} rows, objects or names of connected rooms; "
                "split it into several tables"
            )
            raise SourceError(message, code="table-too-long", where=path)
        if row.count == 0 and not row.room:
            notes["rows of no object and no room (count is 0), left out"] += 1
            continue
        if row.count == 0:
            row = replace(row, category="", count=None)
        spelt.setdefault(row.scene, []).append((row, line))
    categories = {row.category for rows in spelt.values() for row, _ in rows}
    require_few_letters(categories, where=str(path))
    return spelt


def _parse_row(where: str, given: Mapping[str, Any]) -> _TableRow:
    try:
        return _ROW.validate_python({"scene": "", **given})
    except ValidationError as error:
        fault = name_fault(error)
        whole = fault.removeprefix("the whole file: ")  # of a rule for the row
        message = f"{where}: {whole}" if whole != fault else f"{where}, column {fault}"
        raise SourceError(message, code="row-malformed", where=where) from error


def _clean(cell: Any, notes: Counter[str], field: str = "") -> Any:
    """Return what a cell says; None if nothing. All kinds of files come through here."""
    if isinstance(cell, str) and field == "connected":
        cell = cell.split(";")
    if isinstance(cell, list):
        return [said for one in cell if (said := _clean(one, notes)) is not None] or None
    if isinstance(cell, str):
        text, note = _clean_short(cell) if len(cell) <= _LONGEST else _clean_text(cell)
        if note:
            notes[note] += 1
        return text
    return None if cell is None or cell != cell else cell


def _clean_text(text: str) -> tuple[str | None, str]:
    """Return a text trimmed and in one Unicode form, None if it is missing; and what to note."""
    plain = text.strip()
    if plain in _MISSING:
        return None, plain and f"cells that say {plain}, read as empty"
    composed = unicodedata.normalize("NFC", plain)
    return composed, "" if composed == plain else "cells in another Unicode form, read as NFC"


_clean_short = lru_cache(maxsize=2**16)(_clean_text)  # the same text is one object in all rows


def _settle(times: Mapping[str, int]) -> dict[str, str]:
    """Return spelling → name, which is its most frequent spelling; whole numbers lose a `.0`.

    >>> _settle({"Hall": 1, "hall": 2, "bath": 1}), _settle({"3.0": 1, "12.0": 1})
    ({'Hall': 'hall', 'hall': 'hall', 'bath': 'bath'}, {'3.0': '3', '12.0': '12'})
    """
    is_whole = all(map(_WHOLE.fullmatch, times))
    keys = {one: one.partition(".")[0] if is_whole else _fold(one) for one in times}
    names: dict[str, str] = {}
    for spelling in sorted(times, key=lambda one: (-times[one], one)):
        names.setdefault(keys[spelling], keys[spelling] if is_whole else spelling)
    return {spelling: names[key] for spelling, key in keys.items()}


def _fold(name: str) -> str:
    """Return the form by which names are compared: without case, spare spaces, unseen signs."""
    if not name.isascii():
        seen = "".join(c for c in name if unicodedata.category(c) != "Cf")
        name = unicodedata.normalize("NFC", seen.casefold())
    return " ".join(name.casefold().split())


def _settle_rooms(rows: Sequence[_Listed]) -> tuple[Sequence[_Listed], dict[str, str]]:
    """Return the rows of a building with one name for every room, and the names."""
    times = Counter(row.room for row, _ in rows if row.room)
    for row, _ in rows:
        times.update(row.connected)
    names = _settle(times)
    if all(spelling == name for spelling, name in names.items()):
        return rows, names
    return [(_rename(row, names), line) for row, line in rows], names


def _rename(row: _TableRow, names: Mapping[str, str]) -> _TableRow:
    connected = tuple(names[other] for other in row.connected)
    return replace(row, room=names.get(row.room, ""), connected=connected)


def _list_several(names: Mapping[str, str]) -> list[str]:
    """Return the names that are no numbers and have several spellings, each with these."""
    spellings: dict[str, list[str]] = {}
    for spelling, name in sorted(names.items()):
        if not _WHOLE.fullmatch(name):
            spellings.setdefault(name, []).append(spelling)
    several = {name: spelt for name, spelt in spellings.items() if len(spelt) > 1}
    return [f"{name} ({list_some(spelt, _NAMED)})" for name, spelt in sorted(several.items())]


def _note_unread(unread: Sequence[str], columns: Container[str]) -> str:
    free = [field for field in _OPTIONAL if field not in columns]
    hints = [ask_if_meant(column, free) for column in unread[:_SHOWN]]
    shown = [
        f"{column} ({hint})" if hint else column
        for column, hint in zip(unread, hints, strict=False)
    ]
    return _note("columns that are not read", [*shown, *unread[_SHOWN:]], most=_SHOWN)


def _note(what: str, things: Sequence[str], *, most: int = _NAMED) -> str:
    return f"{what}: {list_some(things, most)}" if things else ""


def _gather_facts(rows: Sequence[_Listed], where: str) -> _Facts:
    """Return what the rows of a scene say of its rooms; refuse rows that disagree."""
    facts: _Facts = {row.room: {} for row, _ in rows if row.room}
    for row, line in rows:
        at_line = f"{where}, {line}"
        said = {name: value for name in _FACTS if (value := getattr(row, name)) is not None}
        for name, value in said.items():
            known = facts[row.room].setdefault(name, value)
            if value != known and _fold(str(value)) != _fold(str(known)):
                raise SourceError(
                    f"{at_line}, column {name}: expected {known!r} for room {row.room!r}, as an "
                    f"earlier one says; found {value!r}",
                    code="rows-disagree",
                    where=at_line,
                )
            facts[row.room][name] = min(value, known)  # in whatever order the rows stand
        for other in row.connected:
            if other not in facts or other == row.room:
                raise SourceError(
                    f"{at_line}, column connected: expected names of other rooms with ; between "
                    f"them; found {other!r}. A room without objects is a row without a category",
                    code="room-unknown",
                    where=at_line,
                )
    return facts


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
    """Hash what the rows of a scene say, in whatever order they stand; n objects are n rows."""
    digest, line_feed = hashlib.sha256(), ""
    for said, times in sorted((repr(row.key), row.count or 1) for row in scene[0]):
        for _ in range(times):
            digest.update(f"{line_feed}{said}".encode("utf-8", "surrogatepass"))
            line_feed = "\n"
    return digest.hexdigest()


ROW = SourceRow(
    summary="a table of your own objects, CSV or parquet", open=_ObjectTable, terms=None
)
