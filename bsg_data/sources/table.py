"""Read a user's own buildings from a table of objects, CSV or parquet.

Each row is an object with `scene`, `room`, `category` and optional columns. An object without a
room belongs to the building. A row without a category describes an empty room.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from bsg_data.errors import SourceChangedError, SourceError
from bsg_data.geometry.placement import find_storeys
from bsg_data.scene.class_map import DEFAULT_CLASS_MAP, ClassMap
from bsg_data.scene.connections import GIVEN
from bsg_data.scene.scene_graph import Box, Point, Room, is_scene_id
from bsg_data.sources.annotation_files import require_fingerprint
from bsg_data.sources.annotations import Annotation, Instance
from bsg_data.sources.assembly import assemble, connect_regions
from bsg_data.sources.hm3d_names import keep_one_copy
from bsg_data.sources.source import (
    LICENCE_REF,
    FoundScenes,
    Reading,
    SceneRef,
    SkippedScene,
    SourceRow,
    Terms,
)
from bsg_data.sources.table_rows import Cells, read_cells
from bsg_data.spelling import ask_if_meant, nearest_names

REQUIRED = ("scene", "room", "category")
CENTROID = ("x", "y", "z")
BOX = tuple(f"box_{end}_{axis}" for end in ("min", "max") for axis in CENTROID)
OPTIONAL = ("room_label", "floor", "floor_area", "connected", *CENTROID, *BOX)
MAX_METRES = 10_000.0
MAX_SQUARE_METRES = 1e7
_TEXT = 200  # characters of a name; the longest name of HM3D has 61
_NUMBER = re.compile(r"[0-9]{1,9}")
_DIGITS = re.compile(r"([0-9]+)")
MAX_FLOORS = 1_000.0
_Value = TypeVar("_Value")
_SLACK = 1e-4  # metres that a centroid may stand outside its box: files round


@dataclass(frozen=True, slots=True)
class TableRow:
    """One row of a table.

    Attributes:
        place: where it stands in the file, e.g. `line 12`.
        room: the name of its room; empty for an object of the building.
        category: the name of the object; empty for a room alone.
        room_label: what the room is, e.g. `kitchen`.
        floor: the level of the room, counted as one likes.
        floor_area: of the room, square metres.
        connected: names of rooms that connect to the room.
        centroid: of the object, metres, Z up.
        box: of the object, metres, Z up.
    """

    place: str
    room: str
    category: str
    room_label: str | None = None
    floor: int | None = None
    floor_area: float | None = None
    connected: tuple[str, ...] = ()
    centroid: Point | None = None
    box: Box | None = None

    @property
    def key(self) -> tuple[Any, ...]:
        """What the row says, in an order of its own, without its place in the file."""
        box = (*self.box.minimum, *self.box.maximum) if self.box else ()
        return (
            (self.room, self.category, self.centroid or (), box),
            (self.room_label or "", str(self.floor), str(self.floor_area), self.connected),
        )


@dataclass(frozen=True)
class ObjectTable:
    """A table of objects, CSV (`.csv`, `.tsv`, gzip too) or parquet.

    Attributes:
        path: the file.
        licence: SPDX identifier of its licence; None where it is unknown.
        licence_url: where the licence is to be read; SPDX's own page if it is not given.
        homepage: where the data are to be found.
        citation: how to cite them.
    """

    path: Path
    licence: str | None = None
    licence_url: str | None = None
    homepage: str | None = None
    citation: str | None = None

    def __post_init__(self) -> None:
        _ = self.terms  # refuse what would spoil a card before anything is built

    @property
    def kind(self) -> str:
        """`table`."""
        return "table"

    @property
    def options(self) -> dict[str, int | str]:
        """None that graphs depend on; the terms are in the manifest under their own name."""
        return {}

    @property
    def terms(self) -> Terms | None:
        """The terms that the user gave; None where nobody said any.

        Raises:
            SourceError: if only some of them are given, or one is malformed.
        """
        given = {"licence": self.licence, "homepage": self.homepage, "citation": self.citation}
        missing = [name for name, value in given.items() if value is None]
        if len(missing) == len(given) and self.licence_url is None:
            return None
        if self.licence is None or self.homepage is None or self.citation is None:
            raise SourceError(
                f"the terms of {self.path}: {' and '.join(missing)} missing; give licence, "
                "homepage and citation together, or none of them if the licence is unknown"
            )
        if self.licence_url is None and self.licence.startswith(LICENCE_REF):
            raise SourceError(
                f"licence {self.licence}: give licence_url, too: SPDX has no page of it"
            )
        return Terms(
            licence=self.licence,
            licence_url=self.licence_url or f"https://spdx.org/licenses/{self.licence}.html",
            homepage=self.homepage,
            citation=self.citation,
            sentence=f"The data are under the licence {self.licence}, as {self.homepage} says.",
        )

    def find(self) -> FoundScenes:
        """Find the scenes of the table; columns that are not read are listed as left out."""
        table = self._table()
        refs = (
            SceneRef(
                scene_id=scene,
                location=scene,
                fingerprint=_digest(rows),
                source_split=None,
                source_version=None,
            )
            for scene, rows in table.scenes.items()
        )
        columns = ", ".join(map(_name_unread, table.unread))
        unread = SkippedScene("all", self.path.name, f"columns that are not read: {columns}")
        found = keep_one_copy(refs)
        return FoundScenes(found.scenes, found.duplicates, unused=(unread,) if columns else ())

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one scene; the order of its rows does not matter."""
        rows = sorted(self._listed(ref), key=lambda row: row.key)
        regions = number_rooms({row.room for row in rows if row.room})
        placed = sorted(
            (row for row in rows if row.category),
            key=lambda row: (regions.get(row.room, -1), row.key),
        )
        instances = tuple(
            Instance(
                number,
                row.category,
                regions.get(row.room, -1),
                centroid=row.centroid or (_centre(row.box) if row.box else None),
                box=row.box,
            )
            for number, row in enumerate(placed, start=1)
        )
        graph = assemble(
            Annotation(instances, ref.fingerprint),
            ref=ref,
            kind=self.kind,
            class_map=class_map,
            rooms=_describe_rooms(rows, regions),
        )
        return Reading(connect_regions(graph, _list_connections(rows, regions), method=GIVEN))

    def _listed(self, ref: SceneRef) -> Sequence[TableRow]:
        """Return the rows of a scene, which are those that were listed."""
        try:
            rows = self._table().scenes[ref.scene_id]
        except (SourceError, KeyError) as error:  # it could be read when the scenes were listed
            raise SourceChangedError(f"{self.path}: scene {ref.scene_id}: {error}") from error
        require_fingerprint(f"{self.path}: {ref.scene_id}", _digest(rows), ref.fingerprint)
        return rows

    def _table(self) -> _Table:
        try:
            stat = self.path.stat()
        except OSError as error:
            raise SourceError(f"{self.path}: cannot be read ({error.strerror})") from error
        return _read_table(self.path, stat.st_size, stat.st_mtime_ns)


@dataclass(frozen=True, slots=True)
class _Table:
    scenes: Mapping[str, Sequence[TableRow]]
    unread: tuple[str, ...]


@lru_cache(maxsize=1)
def _read_table(path: Path, size: int, changed: int) -> _Table:
    """Read the table, once for each state of the file."""
    table = read_cells(path, known=(*REQUIRED, *OPTIONAL))
    _require_columns(path, table.columns)
    scenes: dict[str, list[TableRow]] = {}
    for cells in table.rows:
        scene = cells.text("scene")
        if not is_scene_id(scene):
            raise cells.fault("scene", "a name that a file can have", scene)
        scenes.setdefault(scene, []).append(_read_row(cells))
    if not scenes:
        raise SourceError(f"{path}: holds no row; expected an object a row")
    for scene, rows in scenes.items():
        _require_agreement(rows, f"{path}: scene {scene}")
    return _Table(scenes, table.unread)


def _name_unread(column: str) -> str:
    """Name a column that is not read, and the one that may be meant."""
    asked = ask_if_meant(column, OPTIONAL)
    return f"{column} ({asked})" if asked else column


def _require_columns(path: Path, columns: Sequence[str]) -> None:
    missing = [name for name in REQUIRED if name not in columns]
    if missing:
        if len(columns) == 1 and ";" in columns[0]:
            raise SourceError(
                f"{path}: its columns are separated by semicolons; save it with commas, "
                "or with tabs as .tsv"
            )
        near = nearest_names(missing[0], columns, most=1)
        hint = f"; is {near[0]!r} meant?" if near else "."
        raise SourceError(
            f"{path}: no column {missing[0]!r}{hint} Expected {', '.join(REQUIRED)}, in small "
            f"letters, and any of {', '.join(OPTIONAL)}; found {', '.join(columns) or 'none'}"
        )
    for group in (CENTROID, BOX):
        absent = [name for name in group if name not in columns]
        if absent and len(absent) < len(group):
            raise SourceError(
                f"{path}: no column {absent[0]!r}; expected all of {', '.join(group)}, or none"
            )


def _read_row(cells: Cells) -> TableRow:
    row = TableRow(
        place=cells.place,
        room=cells.text("room", limit=_TEXT),
        category=cells.text("category", limit=_TEXT),
        room_label=cells.text("room_label", limit=_TEXT) or None,
        floor=_read_floor(cells),
        floor_area=cells.number("floor_area", limit=MAX_SQUARE_METRES),
        connected=tuple(sorted(filter(None, map(str.strip, cells.text("connected").split(";"))))),
        centroid=_read_point(cells, CENTROID),
        box=_read_box(cells),
    )
    if not row.room and not row.category:
        raise cells.fault("category", "an object, or a room in the column room", "")
    if row.floor_area is not None and row.floor_area <= 0:
        raise cells.fault("floor_area", "square metres above 0", row.floor_area)
    for name in ("room_label", "floor", "floor_area", "connected"):
        if getattr(row, name) not in (None, ()) and not row.room:
            raise cells.fault(name, "nothing where the row has no room", getattr(row, name))
    for name in ("centroid", "box"):
        if getattr(row, name) is not None and not row.category:
            raise cells.fault("category", f"the object whose {name} the row has", "")
    if row.box is not None and row.centroid is not None:
        _require_inside(cells, row.centroid, row.box)
    return row


def _read_floor(cells: Cells) -> int | None:
    floor = cells.number("floor", limit=MAX_FLOORS)
    if floor is not None and not floor.is_integer():
        raise cells.fault("floor", "a whole number", floor)
    return None if floor is None else int(floor)


def _require_inside(cells: Cells, centroid: Point, box: Box) -> None:
    for name, low, value, high in zip(CENTROID, box.minimum, centroid, box.maximum, strict=True):
        if not low - _SLACK <= value <= high + _SLACK:
            raise cells.fault(name, f"a number in the box of the object, {low} to {high}", value)


def _read_point(cells: Cells, names: Sequence[str]) -> Point | None:
    values = [cells.number(name, limit=MAX_METRES) for name in names]
    x, y, z = values
    if x is None or y is None or z is None:
        if any(value is not None for value in values):
            empty = names[values.index(None)]
            raise cells.fault(empty, f"a number, as in the rest of {', '.join(names)}", "nothing")
        return None
    return x, y, z


def _read_box(cells: Cells) -> Box | None:
    low, high = _read_point(cells, BOX[:3]), _read_point(cells, BOX[3:])
    if low is None or high is None:
        if low is not None or high is not None:
            empty = BOX[0] if low is None else BOX[3]
            raise cells.fault(empty, "both corners of the box, or none", "nothing")
        return None
    for name, least, most in zip(BOX[3:], low, high, strict=True):
        if most < least:
            raise cells.fault(name, f"{least} or more, as the lowest corner says", most)
    return Box(low, high)


def _require_agreement(rows: Sequence[TableRow], where: str) -> None:
    """Refuse rows of one room that disagree about it, and connections to rooms that are not there.

    Raises:
        SourceError: naming the line.
    """
    first: dict[tuple[str, str], TableRow] = {}
    names = {row.room for row in rows if row.room}
    for row in rows:
        for name in ("room_label", "floor", "floor_area"):
            value = getattr(row, name)
            if value is None:
                continue
            known = first.setdefault((row.room, name), row)
            if getattr(known, name) != value:
                raise SourceError(
                    f"{where}, {row.place}, column {name}: expected {getattr(known, name)!r} "
                    f"for room {row.room!r}, as {known.place} says; found {value!r}"
                )
        for other in row.connected:
            if other not in names or other == row.room:
                what = "itself" if other == row.room else "a room that no row has"
                raise SourceError(
                    f"{where}, {row.place}, column connected: expected names of other rooms "
                    f"with ; between them; found {other!r}, {what}. A room without objects is a "
                    "row without a category"
                )


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


def _describe_rooms(rows: Sequence[TableRow], regions: Mapping[str, int]) -> list[Room]:
    """Return what the rows tell of the rooms: of their objects, too."""
    of_room: dict[str, list[TableRow]] = {name: [] for name in regions}
    for row in rows:
        if row.room:
            of_room[row.room].append(row)
    rooms = [_describe_room(name, own, regions[name]) for name, own in of_room.items()]
    floors = [_first(row.floor for row in own) for own in of_room.values()]
    levels = sorted({floor for floor in floors if floor is not None})
    if not levels:
        return list(find_storeys(rooms))
    return [
        replace(room, floor_index=None if floor is None else levels.index(floor))
        for room, floor in zip(rooms, floors, strict=True)
    ]


def _describe_room(name: str, rows: Sequence[TableRow], region: int) -> Room:
    """Return a room with the box around its objects; where they are points, with its middle."""
    room = Room(
        room_index=0,
        region_id=region,
        source_label=_first(row.room_label for row in rows)
        or (None if _NUMBER.fullmatch(name) else name),
        floor_area=_first(row.floor_area for row in rows),
    )
    points = [Box(row.centroid, row.centroid) for row in rows if row.centroid is not None]
    boxes = [row.box for row in rows if row.box is not None]
    if not points and not boxes:
        return room
    (a, b, floor), (c, d, _) = around = _surround([*points, *boxes])
    room = replace(room, centroid=_centre(Box(*around)))
    if not boxes:
        return room
    footprint = ((a, b), (c, b), (c, d), (a, d))
    return replace(room, box=Box(*around), floor_z=floor, footprint=footprint)


def _surround(boxes: Sequence[Box]) -> tuple[Point, Point]:
    """Return the lowest and the highest corner of some boxes."""
    low = [min(box.minimum[axis] for box in boxes) for axis in range(3)]
    high = [max(box.maximum[axis] for box in boxes) for axis in range(3)]
    return (low[0], low[1], low[2]), (high[0], high[1], high[2])


def _centre(box: Box) -> Point:
    x, y, z = ((low + high) / 2 for low, high in zip(box.minimum, box.maximum, strict=True))
    return x, y, z


def _first(values: Iterable[_Value | None]) -> _Value | None:
    return next((value for value in values if value is not None), None)


def _list_connections(
    rows: Iterable[TableRow], regions: Mapping[str, int]
) -> Iterable[tuple[int, int]]:
    for row in rows:
        for other in row.connected:
            yield regions[row.room], regions[other]


def _digest(rows: Iterable[TableRow]) -> str:
    """Hash what the rows of a scene say, in whatever order they stand."""
    said = sorted(repr(row.key) for row in rows)
    return hashlib.sha256("\n".join(said).encode("utf-8", "surrogatepass")).hexdigest()


ROW = SourceRow(
    summary="a table of your own objects, CSV or parquet",
    open=ObjectTable,
    terms=None,
    class_map=DEFAULT_CLASS_MAP,
)
