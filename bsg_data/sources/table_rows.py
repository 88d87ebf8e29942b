"""Read the rows of a table of objects, CSV or parquet, by buildings.

Every different cell of a column is cleaned and checked once.
"""

from __future__ import annotations

import re
import unicodedata
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import chain
from pathlib import Path
from typing import Annotated, Any, NamedTuple, TypeVar

import pyarrow as pa
import pyarrow.parquet as pq
from pydantic import (
    AfterValidator,
    BeforeValidator,
    ConfigDict,
    FailFast,
    Field,
    TypeAdapter,
    ValidationError,
)

from bsg_data.errors import SourceError
from bsg_data.inputs.parquet import refusing_damage
from bsg_data.inputs.text_table import SUFFIXES, find_columns, read_csv
from bsg_data.records import Metres, name_fault
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.sources.annotation_files import SceneName, once_for_each_state
from bsg_data.words.nearest import ask_if_meant

_SUFFIXES = (*SUFFIXES, ".parquet")
_REQUIRED = ("scene", "room", "category")
_FACTS = ("room_label", "floor", "floor_area")  # of a room
_CENTROID = ("x", "y", "z")
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in _CENTROID)
_WHOLE = re.compile(r"-?[0-9]+(\.0+)?")  # pandas writes 3.0 for 3 where a column has gaps
_SLACK = 1e-4  # metres that a centroid may stand outside its box: files round
_LONGEST = 200  # characters of a name; the longest of HM3D has 61
_MOST = 100_000  # objects of a row
_SHOWN = 20  # columns in an error or a hint
# What `pandas.read_csv` takes for missing, and pandas' missing time.
_MISSING = {
    *("", "#N/A", "#N/A N/A", "#NA", "-1.#IND", "-1.#QNAN", "-NaN", "-nan", "1.#IND", "1.#QNAN"),
    *("<NA>", "N/A", "NA", "NULL", "NaN", "NaT", "None", "n/a", "nan", "null"),
}
_CONTROL = re.compile("[\0-\x1f\x7f-\x9f\u2028\u2029]")


def _on_one_line(name: str) -> str:
    if _CONTROL.search(name):
        raise ValueError(f"expected a name on one line, without control characters; found {name!r}")
    return name


def _as_list(value: Any) -> Any:
    return value if isinstance(value, list) else [value]


_Kind = TypeVar("_Kind")
_Listed = Annotated[list[_Kind | None], FailFast()]
# Other formats than CSV have numbers in columns of names.
_Name = Annotated[str, Field(max_length=_LONGEST), AfterValidator(_on_one_line)]
_TYPES: Mapping[str, Any] = {  # of the columns that are read
    "scene": Annotated[SceneName, Field(max_length=_LONGEST)],  # the name of a building
    "room": _Name,  # none for an object of the building
    "category": _Name,  # the name of the object; none for a room alone
    "count": Annotated[int, Field(ge=0, le=_MOST)],  # how many such objects there are; none: one
    "room_label": _Name,  # what the room is, e.g. `kitchen`
    "floor": Annotated[int, Field(ge=-1000, le=1000)],  # the level, counted as one likes
    "floor_area": Annotated[float, Field(gt=0, le=1e7)],  # of the room, square metres
    # names of rooms that connect to the room
    "connected": Annotated[tuple[_Name, ...], BeforeValidator(_as_list)],
    **dict.fromkeys((*_CENTROID, *_BOX), Metres),  # where the object is, and its box; Z up
}
FIELDS = tuple(_TYPES)
_OPTIONAL = tuple(name for name in FIELDS if name not in _REQUIRED)
_COLUMNS: Mapping[str, TypeAdapter[Any]] = {
    name: TypeAdapter(_Listed[kind], config=ConfigDict(coerce_numbers_to_str=True))  # type: ignore[valid-type]
    for name, kind in _TYPES.items()
}


class Row(NamedTuple):
    """One row of a scene: an object, equal objects, or a room alone."""

    number: int  # in the file, from 0
    room: str  # empty for an object of the building
    category: str  # empty for a room alone
    times: int  # how many such objects
    room_label: str | None
    floor: int | None
    floor_area: float | None
    connected: tuple[str, ...]
    centroid: Point | None  # as it is given
    box: Box | None

    @property
    def place(self) -> Point | None:
        """Where it is: the middle of its box if it has no other place."""
        return self.centroid or (self.box.centre if self.box else None)

    @property
    def key(self) -> tuple[Any, ...]:
        """What the row says of one object, in an order of its own."""
        box = (*self.box.minimum, *self.box.maximum) if self.box else ()
        return (
            (self.room, self.category, self.centroid or (), box),
            (self.room_label or "", str(self.floor), str(self.floor_area), self.connected),
        )


Facts = dict[str, dict[str, Any]]  # room → what some row says of it, a column of `_FACTS` each
Scene = tuple[Sequence[Row], Facts]


@once_for_each_state
def read_scenes(
    path: Path, named: tuple[tuple[str, int | str], ...]
) -> tuple[Mapping[str, Scene], Sequence[str], Mapping[str, int]]:
    """Read the scenes, in the order of their names; what columns and how much else is not read.

    Args:
        path: of the table.
        named: field and column, of those that the user named.
    """
    name = path.name.casefold()
    if not name.endswith(_SUFFIXES):
        expected = f"a file that ends in {', '.join(_SUFFIXES)}"
        raise SourceError(f"{path}: expected {expected}", code="table-suffix", where=path)
    read = _read_parquet if name.endswith(".parquet") else _read_text
    cells = read(path, {field: str(column) for field, column in named})
    scenes: dict[str, list[Row]] = {}
    for scene, row in _list_rows(cells):
        scenes.setdefault(scene, []).append(row)
    found = {
        scene: (rows, _gather_facts(rows, cells, scene)) for scene, rows in sorted(scenes.items())
    }
    return found, _hint_unread(cells), cells.left_out


@dataclass(frozen=True)
class _Cells:
    """The columns of a file that are read."""

    path: Path
    header: Sequence[str]
    columns: Mapping[str, int]  # field → the number of its column
    words: Mapping[str, Sequence[Any]]  # field → its different cells
    codes: Mapping[str, Sequence[int]]  # field → which of these is in a row
    lines: Sequence[int] = ()  # of the rows of a text
    left_out: Counter[str] = field(default_factory=Counter)

    def where(self, row: int, *, within: str = "") -> str:
        """Return how errors name a row."""
        place = f"line {self.lines[row]}" if self.lines else f"row {row + 1}"
        return f"{self.path}{within}, {place}"


def _read_text(path: Path, named: Mapping[str, str]) -> _Cells:
    rows = read_csv(path)
    _, names = next(rows, (0, list[str]()))
    header = [name.strip() for name in names]
    columns, lines = _find_columns(path, header, named), array("q")
    words: dict[str, dict[str, int]] = {field: {} for field in columns}
    codes = {field: array("q") for field in columns}
    read = [(words[field], codes[field], at) for field, at in columns.items()]
    repeated = 0  # of tables that were joined
    for line, row in rows:
        if row == names:
            repeated += 1
            continue
        lines.append(line)
        for known, numbers, at in read:
            numbers.append(known.setdefault(row[at], len(known)))
    left_out = Counter({"rows that repeat the header, left out": repeated})
    different = {field: [*words[field]] for field in words}
    return _Cells(path, header, columns, different, codes, lines, left_out)


def _read_parquet(path: Path, named: Mapping[str, str]) -> _Cells:
    words: dict[str, Sequence[Any]] = {}
    codes: dict[str, Sequence[int]] = {}
    with refusing_damage(path), pq.ParquetFile(path) as file:
        names = file.schema_arrow.names
        columns = _find_columns(path, header := [name.strip() for name in names], named)
        for field, at in columns.items():
            if pa.types.is_nested(file.schema_arrow.field(at).type):
                fault = "expected text, found lists; put ; between names"
                message = f"{path}, column {names[at]}: {fault}"
                raise SourceError(message, code="table-lists", where=path)
            column = file.read([names[at]]).column(0).combine_chunks().dictionary_encode()
            words[field] = [*column.dictionary.to_pylist(), None]
            codes[field] = column.indices.fill_null(len(column.dictionary)).to_pylist()
        if len({*map(len, codes.values())}) > 1:
            raise OSError("its columns have different numbers of rows")
    return _Cells(path, header, columns, words, codes)


def _find_columns(path: Path, header: Sequence[str], named: Mapping[str, str]) -> dict[str, int]:
    """Return field → number of its column; of a place, all columns must be there."""
    wanted = {field: [named.get(field, field)] for field in FIELDS}
    rename = "name yours by --option {field}=COLUMN"
    found = find_columns(path, header, wanted, required=_REQUIRED, rename=rename)
    groups = [group for group in (_CENTROID, _BOX) if set(group) & set(found)]
    required = tuple(dict.fromkeys((*named, *_REQUIRED, *chain.from_iterable(groups))))
    return find_columns(path, header, wanted, required=required, rename=rename)


def _list_rows(cells: _Cells) -> Iterator[tuple[str, Row]]:
    """Yield the rows that say something, each with its scene."""
    absent = [None] * len(cells.codes["scene"])
    columns = {
        field: _read_column(cells, field) if field in cells.columns else absent for field in FIELDS
    }
    _write_whole_numbers(columns, "scene")
    _write_whole_numbers(columns, "room", "connected")
    for number, values in enumerate(zip(*columns.values(), strict=True)):
        if not any(value is not None for value in values):  # as at the ends of spreadsheets
            continue
        for fault in _find_faults(dict(zip(FIELDS, values, strict=True))):
            where = cells.where(number)
            raise SourceError(f"{where}: {fault}", code="row-malformed", where=where)
        scene, room, category, count, label, floor, area, connected, *places = values
        if count == 0 and room is None:
            cells.left_out["rows of no object and no room (count is 0), left out"] += 1
            continue
        point, low, high = (tuple(places[at : at + 3]) for at in (0, 3, 6))
        centroid = None if None in point else point
        box = None if None in low else Box(low, high)
        name = "" if count == 0 else category or ""
        facts = (label, floor, area, connected or ())
        yield scene, Row(number, room or "", name, count or 1, *facts, centroid, box)


def _write_whole_numbers(columns: dict[str, list[Any]], field: str, lists: str = "") -> None:
    """Take `.0` from the names in a column, and in one of lists of them, if all are numbers."""
    listed = columns.get(lists, [])
    names = {*columns[field], *chain.from_iterable(names or () for names in listed)} - {None}
    if all(map(_WHOLE.fullmatch, names)):
        whole = {name: name.partition(".")[0] for name in names}
        columns[field] = [whole.get(name) for name in columns[field]]
        if lists:
            columns[lists] = [names and tuple(map(whole.get, names)) for names in listed]


def _find_faults(cells: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the cells of a row do not fit together."""
    room, category, count = cells["room"], cells["category"], cells["count"]
    if cells["scene"] is None:
        yield "scene: expected the name of a building, found none"
    if room is None and category is None:
        yield "category: expected an object, or a room in the column room"
    if room is None and any(cells[name] is not None for name in (*_FACTS, "connected")):
        yield "room: expected the room that the row describes, found none"
    if count and category is None:
        yield f"count: expected none without a category, found {count}"
    for group in (_CENTROID, _BOX):
        absent = [name for name in group if cells[name] is None]
        if len(absent) == len(group):
            continue
        if absent:
            yield f"{absent[0]}: expected a number, as in the rest of {group}"
        if category is None:
            yield f"category: expected the object that is at {group[0]}"
        if count not in (None, 1):
            yield f"count: expected 1, as the object has a place; found {count}"
    for axis in _CENTROID if cells["box_min_x"] is not None else ():
        value, low, high = (cells[name] for name in (axis, f"box_min_{axis}", f"box_max_{axis}"))
        if low > high:
            yield f"box_max_{axis}: expected {low} or more, found {high}"
        if value is not None and not low - _SLACK <= value <= high + _SLACK:
            yield f"{axis}: expected {low} to {high}, its box; found {value}"


def _read_column(cells: _Cells, field: str) -> list[Any]:
    """Return what each row says in a column; an error names the first row of a cell."""
    codes = cells.codes[field]
    words = _clean(cells.words[field])
    for number, times in Counter(codes).items():
        cell = cells.words[field][number]
        if words[number] is None and isinstance(cell, str) and cell.strip():
            cells.left_out[f"cells that say {cell.strip()}, read as empty"] += times
    if field == "connected":
        words = [_split(word) if isinstance(word, str) else word for word in words]
    try:
        checked = _COLUMNS[field].validate_python(words)
    except ValidationError as error:
        at, _, fault = name_fault(error).partition(": ")
        code, *inner = at.split(".")
        where = cells.where(codes.index(int(code)))
        message = f"{where}, column {'.'.join((field, *inner))}: {fault}"
        raise SourceError(message, code="row-malformed", where=where) from error
    return [checked[code] for code in codes]


def _clean(cells: Sequence[Any]) -> list[Any]:
    """Return what cells say; None if nothing. All kinds of files come through here."""
    texts = (cell.decode("utf-8", "replace") if isinstance(cell, bytes) else cell for cell in cells)
    words = [
        unicodedata.normalize("NFC", cell.strip()) if isinstance(cell, str) else cell
        for cell in texts
    ]
    return [None if word in _MISSING or word != word else word for word in words]


def _split(names: str) -> list[str] | None:
    return sorted(name for name in _clean(names.split(";")) if name is not None) or None


def _hint_unread(cells: _Cells) -> list[str]:
    """Return the columns that are not read, the first ones each with the field it may be."""
    read = set(cells.columns.values())
    unread = [name for number, name in enumerate(cells.header) if number not in read]
    free = [field for field in _OPTIONAL if field not in cells.columns]
    hints = [ask_if_meant(column, free) for column in unread[:_SHOWN]]
    asked = [
        f"{column} ({hint})" if hint else column
        for column, hint in zip(unread, hints, strict=False)
    ]
    return asked + unread[_SHOWN:]


def _gather_facts(rows: Sequence[Row], cells: _Cells, scene: str) -> Facts:
    """Return what the rows of a scene say of its rooms; refuse rows that disagree."""
    facts: Facts = {row.room: {} for row in rows if row.room}
    for row in rows:
        for code, fault in _take_facts(row, facts):
            where = cells.where(row.number, within=f": scene {scene}")
            raise SourceError(f"{where}, column {fault}", code=code, where=where)
    return facts


def _take_facts(row: Row, facts: Facts) -> Iterator[tuple[str, str]]:
    """Take up what a row says of its room; yield how it cannot be."""
    for name in _FACTS:
        value = getattr(row, name)
        if value is None:
            continue
        known = facts[row.room].setdefault(name, value)
        if value != known:
            fault = f"expected {known!r} for room {row.room!r}, as an earlier one says"
            yield "rows-disagree", f"{name}: {fault}; found {value!r}"
    for other in row.connected:
        if other not in facts or other == row.room:
            fault = f"expected names of other rooms with ; between them; found {other!r}"
            hint = "A room without objects is a row without a category"
            yield "room-unknown", f"connected: {fault}. {hint}"
