"""Read the rows of a table of objects, CSV or parquet, by buildings.

Every different cell of a column is cleaned and checked once. Then buildings, and the rooms of each,
get one name for all spellings of it.
"""

from __future__ import annotations

import re
import unicodedata
from array import array
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
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
from bsg_data.inputs.text_table import SUFFIXES, hint_separator, read_csv
from bsg_data.records import Metres, name_fault
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.sources.annotation_files import SceneName, once_for_each_state
from bsg_data.words.nearest import ask_if_meant, nearest_names
from bsg_data.words.shown import list_some

_SUFFIXES = (*SUFFIXES, ".parquet")
_REQUIRED = ("scene", "room", "category")
_FACTS = ("room_label", "floor", "floor_area")  # of a room
_CENTROID = ("x", "y", "z")
_BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in _CENTROID)
_WHOLE = re.compile(r"-?[0-9]+(\.0+)?")  # pandas writes 3.0 for 3 where a column has gaps
_SLACK = 1e-4  # metres that a centroid may stand outside its box: files round
_LONGEST = 200  # characters of a name; the longest of HM3D has 61
_MOST = 100_000  # objects of a row
_NAMED = 5  # things in a note; the others are counted
_SHOWN = 20  # columns in an error or a note
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
) -> tuple[Mapping[str, Scene], Sequence[str]]:
    """Read the scenes, and notes of what differs from the file.

    Args:
        path: of the table.
        named: field and column, of those that the user named.
    """
    name, notes = path.name.casefold(), Counter[str]()
    if not name.endswith(_SUFFIXES):
        expected = f"a file that ends in {', '.join(_SUFFIXES)}"
        raise SourceError(f"{path}: expected {expected}", code="table-suffix", where=path)
    read = _read_parquet if name.endswith(".parquet") else _read_text
    cells = read(path, {field: str(column) for field, column in named}, notes)
    spelt: dict[str, list[Row]] = {}
    for scene, row in _list_rows(cells, notes):
        spelt.setdefault(scene, []).append(row)
    names = _settle({spelling: len(rows) for spelling, rows in spelt.items()})
    scenes: dict[str, list[Row]] = {}
    for spelling, scene in names.items():
        scenes.setdefault(scene, []).extend(spelt.pop(spelling))
    found: dict[str, Scene] = {}
    several: list[str] = []  # rooms
    for scene in sorted(scenes):
        settled, rooms = _settle_rooms(scenes.pop(scene))
        several += (f"{said} in {scene}" for said in _list_several(rooms))
        found[scene] = settled, _gather_facts(settled, cells, scene)
    said = [
        ("columns that are not read", _hint_unread(cells), _SHOWN),
        ("buildings of several spellings, each read as one", _list_several(names), _NAMED),
        ("rooms of several spellings, each read as one", several, _NAMED),
    ]
    lists = [f"{what}: {list_some(things, most)}" for what, things, most in said if things]
    return found, [
        *lists,
        *(f"{what}: {times:,}" for what, times in sorted(notes.items()) if times),
    ]


@dataclass(frozen=True)
class _Cells:
    """The columns of a file that are read."""

    path: Path
    header: Sequence[str]
    columns: Mapping[str, int]  # field → the number of its column
    words: Mapping[str, Sequence[Any]]  # field → its different cells
    codes: Mapping[str, Sequence[int]]  # field → which of these is in a row
    lines: Sequence[int] = ()  # of the rows of a text

    def where(self, row: int, *, within: str = "") -> str:
        """Return how errors name a row."""
        place = f"line {self.lines[row]}" if self.lines else f"row {row + 1}"
        return f"{self.path}{within}, {place}"


def _read_text(path: Path, named: Mapping[str, str], notes: Counter[str]) -> _Cells:
    rows = read_csv(path)
    _, names = next(rows, (0, list[str]()))
    header = [name.strip() for name in names]
    columns, lines = _find_columns(path, header, named), array("q")
    words: dict[str, dict[str, int]] = {field: {} for field in columns}
    codes = {field: array("q") for field in columns}
    read = [(words[field], codes[field], at) for field, at in columns.items()]
    for line, row in rows:
        if row == names:
            notes["rows that repeat the header, left out"] += 1  # tables that were joined
            continue
        lines.append(line)
        for known, numbers, at in read:
            numbers.append(known.setdefault(row[at], len(known)))
    return _Cells(path, header, columns, {field: [*words[field]] for field in words}, codes, lines)


def _read_parquet(path: Path, named: Mapping[str, str], _: Counter[str]) -> _Cells:
    words: dict[str, Sequence[Any]] = {}
    codes: dict[str, Sequence[int]] = {}
    with refusing_damage(path), pq.ParquetFile(path) as file:
        names = file.schema_arrow.names
        columns = _find_columns(path, header := [name.strip() for name in names], named)
        for field, at in columns.items():
            if pa.types.is_nested(file.schema_arrow.field(at).type):
                said = "expected text, found lists; put ; between names"
                message = f"{path}, column {names[at]}: {said}"
                raise SourceError(message, code="table-lists", where=path)
            column = file.read([names[at]]).column(0).combine_chunks().dictionary_encode()
            words[field] = [*column.dictionary.to_pylist(), None]
            codes[field] = column.indices.fill_null(len(column.dictionary)).to_pylist()
        if len({*map(len, codes.values())}) > 1:
            raise OSError("its columns have different numbers of rows")
    return _Cells(path, header, columns, words, codes)


def _find_columns(path: Path, header: Sequence[str], named: Mapping[str, str]) -> dict[str, int]:
    """Return field → number of its column, spelt as asked, else in other letters or spaces."""
    folded = [*map(_fold, header)]
    columns: dict[str, int] = {}
    for field in FIELDS:
        asked = named.get(field, field).strip()
        same = [at for at, name in enumerate(header) if name == asked]
        found = same or [at for at, name in enumerate(folded) if name == _fold(asked)]
        if len(found) > 1:
            shown = list_some([header[at] for at in found], _SHOWN)
            message = f"{path}: the column {asked!r} twice, as {shown}"
            raise SourceError(message, code="column-twice", where=path)
        if found:
            columns[field] = found[0]
    groups = [group for group in (_CENTROID, _BOX) if set(group) & set(columns)]
    for field in (*named, *_REQUIRED, *chain.from_iterable(groups)):
        if field not in columns:
            raise _lack_column(path, field, named.get(field, field), header, columns)
    return columns


def _lack_column(
    path: Path, field: str, asked: str, header: Sequence[str], columns: Mapping[str, int]
) -> SourceError:
    near = nearest_names(asked, _list_unread(header, columns)[:_SHOWN], most=1)
    hint = f"name yours by --option {field}=COLUMN"
    if near:
        hint = f"did you mean {near[0]}? Then give --option {field}={near[0]}"
    return SourceError(
        f"{path}: no column {asked!r}; {hint_separator(header) or hint}. Expected a header with "
        f"{', '.join(_REQUIRED)}, and any of {', '.join(_OPTIONAL)}; found "
        f"{list_some(header, _SHOWN) or 'none'}",
        code="column-missing",
        where=path,
    )


def _list_unread(header: Sequence[str], columns: Mapping[str, int]) -> list[str]:
    read = set(columns.values())
    return [name for number, name in enumerate(header) if number not in read]


def _list_rows(cells: _Cells, notes: Counter[str]) -> Iterator[tuple[str, Row]]:
    """Yield the rows that say something, each with its scene; count those that do not."""
    absent = [None] * len(cells.codes["scene"])
    columns = [
        _read_column(cells, field, notes) if field in cells.columns else absent for field in FIELDS
    ]
    for number, (scene, *said) in enumerate(zip(*columns, strict=True)):
        room, category, count, label, floor, area, connected, *places = said
        if said.count(None) == len(said):
            # else the row is empty, as at the ends of spreadsheets
            notes["rows of a building alone, left out"] += scene is not None
            continue
        for fault in _find_faults(scene, dict(zip(FIELDS[1:], said, strict=True))):
            where = cells.where(number)
            raise SourceError(f"{where}: {fault}", code="row-malformed", where=where)
        if count == 0 and room is None:
            notes["rows of no object and no room (count is 0), left out"] += 1
            continue
        point, low, high = (tuple(places[at : at + 3]) for at in (0, 3, 6))
        centroid = None if None in point else point
        box = None if None in low else Box(low, high)
        name = "" if count == 0 else category or ""
        facts = (label, floor, area, connected or ())
        yield scene, Row(number, room or "", name, count or 1, *facts, centroid, box)


def _find_faults(scene: str | None, said: Mapping[str, Any]) -> Iterator[str]:
    """Yield how the cells of a row do not fit together."""
    room, category, count = said["room"], said["category"], said["count"]
    if scene is None:
        yield "scene: expected the name of a building, found none"
    if room is None and category is None:
        yield "category: expected an object, or a room in the column room"
    if room is None and any(said[name] is not None for name in (*_FACTS, "connected")):
        yield "room: expected the room that the row describes, found none"
    if count and category is None:
        yield f"count: expected none without a category, found {count}"
    for group in (_CENTROID, _BOX):
        absent = [name for name in group if said[name] is None]
        if len(absent) == len(group):
            continue
        if absent:
            yield f"{absent[0]}: expected a number, as in the rest of {group}"
        if category is None:
            yield f"category: expected the object that is at {group[0]}"
        if count not in (None, 1):
            yield f"count: expected 1, as the object has a place; found {count}"
    for axis in _CENTROID if said["box_min_x"] is not None else ():
        value, low, high = (said[name] for name in (axis, f"box_min_{axis}", f"box_max_{axis}"))
        if low > high:
            yield f"box_max_{axis}: expected {low} or more, found {high}"
        if value is not None and not low - _SLACK <= value <= high + _SLACK:
            yield f"{axis}: expected {low} to {high}, its box; found {value}"


def _read_column(cells: _Cells, field: str, notes: Counter[str]) -> list[Any]:
    """Return what each row says in a column; an error names the first row of a cell."""
    codes = cells.codes[field]
    times = Counter(codes)
    words = [
        _clean(word, field, notes, times[code]) for code, word in enumerate(cells.words[field])
    ]
    try:
        checked = _COLUMNS[field].validate_python(words)
    except ValidationError as error:
        at, _, said = name_fault(error).partition(": ")
        code, *inner = at.split(".")
        where = cells.where(codes.index(int(code)))
        message = f"{where}, column {'.'.join((field, *inner))}: {said}"
        raise SourceError(message, code="row-malformed", where=where) from error
    return [checked[code] for code in codes]


def _clean(cell: Any, field: str, notes: Counter[str], times: int) -> Any:
    """Return what a cell says; None if nothing. All kinds of files come through here."""
    if isinstance(cell, bytes):  # as some programs write text
        cell = cell.decode("utf-8", "replace")
    if isinstance(cell, str) and field == "connected":
        said = (_clean(one, "", notes, times) for one in cell.split(";"))
        return sorted(one for one in said if one is not None) or None
    if isinstance(cell, str):
        text = cell.strip()
        if text in _MISSING:
            if text:
                notes[f"cells that say {text}, read as empty"] += times
            return None
        composed = unicodedata.normalize("NFC", text)
        if composed != text:
            notes["cells in another Unicode form, read as NFC"] += times
        return composed
    return None if cell is None or cell != cell else cell


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


def _settle_rooms(rows: Sequence[Row]) -> tuple[Sequence[Row], dict[str, str]]:
    """Return the rows of a building with one name for every room, and the names."""
    times = Counter(row.room for row in rows if row.room)
    times.update(chain.from_iterable(row.connected for row in rows))
    names = _settle(times)
    if all(spelling == name for spelling, name in names.items()):
        return rows, names
    renamed = (
        row._replace(
            room=names.get(row.room, ""), connected=tuple(names[other] for other in row.connected)
        )
        for row in rows
    )
    return [*renamed], names


def _list_several(names: Mapping[str, str]) -> list[str]:
    """Return the names that are no numbers and have several spellings, each with these."""
    spellings: dict[str, list[str]] = {}
    for spelling, name in sorted(names.items()):
        if not _WHOLE.fullmatch(name):
            spellings.setdefault(name, []).append(spelling)
    several = {name: spelt for name, spelt in spellings.items() if len(spelt) > 1}
    return [f"{name} ({list_some(spelt, _NAMED)})" for name, spelt in sorted(several.items())]


def _hint_unread(cells: _Cells) -> list[str]:
    """Return the columns that are not read, the first ones each with the field it may be."""
    unread = _list_unread(cells.header, cells.columns)
    free = [field for field in _OPTIONAL if field not in cells.columns]
    hints = [ask_if_meant(column, free) for column in unread[:_SHOWN]]
    asked = [f"{one} ({hint})" if hint else one for one, hint in zip(unread, hints, strict=False)]
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
        if value != known and _fold(str(value)) != _fold(str(known)):
            said = f"expected {known!r} for room {row.room!r}, as an earlier one says"
            yield "rows-disagree", f"{name}: {said}; found {value!r}"
        facts[row.room][name] = min(value, known)  # in whatever order the rows stand
    for other in row.connected:
        if other not in facts or other == row.room:
            said = f"expected names of other rooms with ; between them; found {other!r}"
            hint = "A room without objects is a row without a category"
            yield "room-unknown", f"connected: {said}. {hint}"
