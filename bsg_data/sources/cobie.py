"""COBie: the spreadsheet of spaces and equipment that the owner of a building gets at handover.

The sheets are tables of text that refer to one another by names: a `Component` has a `TypeName` and
a `Space`, a `Space` a `FloorName`. An empty cell says nothing, and neither do `n/a`, `Not Found`
and the other words that programs and people put where they have none. COBie is defined in the
National BIM Standard – United States, version 3, chapter 4.2.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import ClassVar

from bsg_data.dataset.manifest import SkippedScene
from bsg_data.errors import SourceError
from bsg_data.inputs.spreadsheet import read_sheets
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import is_understood, label_of
from bsg_data.scene.surroundings import BUILDING_KINDS, is_floor_area
from bsg_data.scene.synonyms import UNKNOWN
from bsg_data.sources.annotation_files import find_files, read_scene_file
from bsg_data.sources.assembly import assemble
from bsg_data.sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    SourceRow,
)

_Row = Mapping[str, str]  # column, in small letters → text; without columns that say nothing
_Sheets = Mapping[str, list[_Row]]
_SHEETS = ("facility", "floor", "space", "type", "component")
# Words, without what is between them, that say nothing: `n/a`, `N.A.`, `Not Found`, `--`.
_SILENT = frozenset(
    {
        *("", "na", "nan", "nil", "none", "null", "tba", "tbc", "tbd"),
        *("notapplicable", "notavailable", "notfound", "notdefined", "notspecified"),
        *("notassigned", "notknown", "notset", "tobedefined", "tobedetermined", "tobeconfirmed"),
        *("unknown", "undefined", "unspecified", "unassigned", "unclassified", "unset"),
    }
)
_SEVERAL = -1  # spaces have this name
_LONGEST_SILENT = 40  # characters, with what is between the words
_WORD = re.compile(r"[^\W_]+")
_FORMULA = re.compile(r"#[A-Z0/]+[!?]")  # the error of a formula: `#REF!`, `#NAME?`
_CODE = re.compile(r"[\w. -]{1,60}")  # before a colon: `13-41 11 14 21`, `SL_35_80_89`
# In m², by the words of areas, and of lengths where a facility says those.
_UNITS = {
    **dict.fromkeys(("squarefeet", "squarefoot", "sqft", "sq.ft", "sq.ft.", "ft2"), 0.3048**2),
    **dict.fromkeys(("ft²", "feet", "foot", "ft"), 0.3048**2),
    **dict.fromkeys(("squaremeters", "squaremetres", "squaremeter", "squaremetre", "sqm"), 1.0),
    **dict.fromkeys(("sq.m", "sq.m.", "m2", "m²", "m", "meters", "metres", "meter", "metre"), 1.0),
}
# Families of Revit put these before the name of the thing: `M_Chair-Executive: 600 x 900`.
_PREFIXES = frozenset({"", "m", "equip", "equipment", "fixture", "furniture", "generic"})
_ENDS = re.compile(r"[-_:;,/()]|\s(?=[0-9]|type\b)", re.IGNORECASE)
# Words of the kind of a facility, for kinds that models know under another word.
_FACILITIES = {
    **dict.fromkeys(("residence", "residential", "apartment", "dwelling", "house"), "home"),
    **dict.fromkeys(("university", "college", "classroom", "kindergarten"), "school"),
    **dict.fromkeys(("retail", "store", "market"), "shop"),
    **dict.fromkeys(("clinic", "hospital", "medical", "healthcare"), "clinic"),
    **{kind: kind for kind in BUILDING_KINDS},
}


@dataclass(frozen=True)
class _CobieSheets:
    """A folder with COBie spreadsheets (`.xlsx`) anywhere below it, or one of them.

    A spreadsheet is a building, a space a room, and a component an object, which has the first name
    that the class map knows of: the description of its type, the type's name, the title of its
    category. A door between two spaces connects them; anything else in several is in the first.
    """

    path: Path

    kind = "cobie"
    options: ClassVar[dict[str, int | str]] = {}

    def find(self) -> FoundScenes:
        """Find every `.xlsx`."""
        expected = "no COBie spreadsheet found; expected files named <building>.xlsx"
        return find_files(self.path, ".xlsx", expected=expected, is_path=True)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one building; what refers to nothing is counted in the reading's `left_out`."""
        path, data = read_scene_file(self.path, ref)
        sheets = _read_sheets(data, path)
        spaces = _list_spaces(sheets["space"])
        if not spaces:
            raise SourceError(
                f"{path}: expected a sheet Space with a column Name and a row for each room",
                code="sheet-missing",
                where=path,
            )
        notes: Counter[str] = Counter()
        rooms = _list_rooms(spaces, sheets, notes)
        objects, doors = _list_components(sheets, _number_spaces(spaces), class_map, notes)
        annotation = Annotation(
            [region for region, _ in objects],
            [name for _, name in objects],
            rooms=rooms,
            doors=doors,
            method="door",
            building_kind=_find_kind(sheets),
            sha256=hashlib.sha256(data).hexdigest(),
        )
        graph = assemble(annotation, ref=ref, kind=self.kind, class_map=class_map)
        reasons = (f"{number:,} {what}" for what, number in notes.items() if number)
        left_out = tuple(SkippedScene(ref.scene_id, ref.location, reason) for reason in reasons)
        return Reading(graph, left_out=left_out)


def _read_sheets(data: bytes, path: Path) -> dict[str, list[_Row]]:
    """Return the rows of each sheet that is read; a sheet that is not there has none.

    The first row of a sheet that is not empty names its columns.
    """
    sheets: dict[str, list[_Row]] = {name: [] for name in _SHEETS}
    headers: dict[str, dict[int, str]] = {}
    try:
        for title, row in read_sheets(data, lambda title: _key(title) in sheets):
            if title not in headers:
                headers[title] = {column: _key(name) for column, name in row.items()}
                continue
            header = headers[title]
            cells = {
                header[column]: text
                for column, text in row.items()
                if header.get(column) and not _is_silent(text)
            }
            if cells:
                sheets[_key(title)].append(cells)
    except ValueError as error:
        raise SourceError(
            f"{path}: expected a spreadsheet ({error})", code="spreadsheet-malformed", where=path
        ) from error
    return sheets


def _is_silent(text: str) -> bool:
    """Return whether a cell says nothing; `n/a: n/a` of a classification does not, either."""
    if len(text) > _LONGEST_SILENT:
        return False
    pieces = ("".join(_WORD.findall(piece)).casefold() for piece in text.split(":"))
    return bool(_FORMULA.fullmatch(text)) or all(piece in _SILENT for piece in pieces)


def _key(name: str) -> str:
    """Return the form by which names refer to one another: case and spaces do not matter."""
    return "".join(name.casefold().split())


def _index(rows: Iterable[_Row]) -> dict[str, _Row]:
    """Return the rows of a sheet by name; of several with one name, the first."""
    return {_key(row["name"]): row for row in reversed([*rows]) if "name" in row}


def _list_spaces(rows: Iterable[_Row]) -> list[_Row]:
    """Return the spaces with a name; of several with one name on one floor, the first."""
    found: dict[tuple[str, str], _Row] = {}
    for row in rows:
        if "name" in row:
            found.setdefault((_key(row["name"]), _key(row.get("floorname", ""))), row)
    return list(found.values())


def _number_spaces(spaces: Sequence[_Row]) -> dict[str, int]:
    """Return the number of the space of a name; `_SEVERAL` if spaces on several floors have it."""
    regions: dict[str, int] = {}
    for number, row in enumerate(spaces):
        name = _key(row["name"])
        regions[name] = _SEVERAL if name in regions else number
    return regions


def _list_rooms(
    spaces: Sequence[_Row], sheets: _Sheets, notes: Counter[str]
) -> list[AnnotatedRoom]:
    lost = len(sheets["space"]) - len(spaces)
    notes["spaces have no name or that of an earlier one of their floor: they are left out"] += lost
    said_unit = _get_facility(sheets).get("areaunits")
    levels, unit = _rank_floors(sheets, spaces), _UNITS.get(_key(said_unit or "m2"))
    rooms = []
    for number, row in enumerate(spaces):
        label, common = _name_room(row)
        floor = levels.get(_key(row.get("floorname", "")))
        given = [row[name] for name in ("netarea", "grossarea") if name in row]
        areas = [value * (unit or math.nan) for text in given if (value := _number(text))]
        area = next(filter(is_floor_area, areas), None)
        if floor is None:
            notes["spaces are on a floor without an elevation: their level is not known"] += 1
        if given and not unit:
            notes["spaces have an area in an unknown unit: it is left out"] += 1
        elif given and area is None:
            notes["spaces have an area that is no possible number: it is left out"] += 1
        elif area and not said_unit:
            notes["spaces have an area without a unit: it is read as m²"] += 1
        rooms.append(
            AnnotatedRoom(
                region=number,
                source_label=label,
                label=common,
                floor_index=floor,
                floor_area=area,
            )
        )
    return rooms


def _name_room(space: _Row) -> tuple[str, str | None]:
    """Return the first of kind, description, name and tag that says what a room is, and its label.

    The tag is what the sign at the door says: mostly a number, and a name with it.
    """
    kind = _strip_code(space.get("category", ""))
    texts = (kind, *(space.get(column, "") for column in ("description", "name")))
    words = [word for word in (*texts, _strip_numbers(space.get("roomtag", ""))) if word]
    found = ((word, label_of("cobie", word)) for word in words)
    unknown = (word for word in words if not is_understood("cobie", word))  # not a number
    return next(((word, label) for word, label in found if label), (next(unknown, words[0]), None))


def _strip_code(category: str) -> str:
    """Return the title of a category, without the code of its classification; empty if silent."""
    code, _, title = category.partition(":")
    if not (_CODE.fullmatch(code) and any(letter.isdigit() for letter in code) and title.strip()):
        return category
    return "" if _is_silent(title) else title.strip()


def _strip_numbers(tag: str) -> str:
    """Return a tag without its words with digits, unless these are all: `Entry Lobby 20INT.04`."""
    words = [word for word in tag.split() if not any(letter.isdigit() for letter in word)]
    return " ".join(words) or tag


def _rank_floors(sheets: _Sheets, spaces: Iterable[_Row]) -> dict[str, int]:
    """Return floor → level from 0 at the bottom, of the floors that have spaces and elevations."""
    used = {_key(row.get("floorname", "")) for row in spaces}
    floors = _index(sheets["floor"])
    heights = {name: _number(row.get("elevation")) for name, row in floors.items()}
    known = {name: z for name, z in heights.items() if z is not None and name in used}
    ranks = {z: level for level, z in enumerate(sorted(set(known.values())))}
    return {name: ranks[z] for name, z in known.items()}


def _get_facility(sheets: _Sheets) -> _Row:
    return next(iter(sheets["facility"]), {})


def _find_kind(sheets: _Sheets) -> str | None:
    words = re.findall(r"[a-z]+", _get_facility(sheets).get("category", "").casefold())
    singular = (word.removesuffix("s") for word in words)
    return next((_FACILITIES[word] for word in singular if word in _FACILITIES), None)


def _number(text: str | None) -> float | None:
    try:
        value = float(text or "nan")
    except ValueError:
        return None
    return value if math.isfinite(value) else None


def _list_components(
    sheets: _Sheets,
    regions: Mapping[str, int],
    class_map: ClassMap,
    notes: Counter[str],
) -> tuple[list[tuple[int, str]], list[tuple[int, int]]]:
    """Return room and name of the objects, and the pairs of rooms that doors are in."""
    types = _index(sheets["type"])
    words = {name: _name_type(row, class_map) for name, row in types.items()}
    objects, doors = [], []
    for row in sheets["component"]:
        word = words.get(_key(row.get("typename", "")))
        if word is None:
            notes["components have no type in the sheet Type: their own words name them"] += 1
            word = _name_type(row, class_map)
        rooms = _find_rooms(row.get("space", ""), regions, notes)
        if class_map.classify(word).category == "door" and len(rooms) == 2:
            doors.append((rooms[0], rooms[1]))
        objects.append((rooms[0] if rooms else -1, word))
    return objects, doors


def _find_rooms(listed: str, regions: Mapping[str, int], notes: Counter[str]) -> list[int]:
    """Return the rooms that a component lists, once each; commas or semicolons are between them."""
    pieces = (piece for piece in re.split("[,;]", listed) if not _is_silent(piece))
    names = [listed] if _key(listed) in regions else list(pieces)
    known = [(name, regions[_key(name)]) for name in names if _key(name) in regions]
    if not names:
        notes["components name no space: they belong to the building"] += 1
    notes["names of spaces of components are not in the sheet Space"] += len(names) - len(known)
    for name in (name for name, region in known if region == _SEVERAL):
        notes[
            f"components are in {name.strip()}, as spaces of several floors are called: in no room"
        ] += 1
    return list(dict.fromkeys(region for _, region in known if region != _SEVERAL))


def _name_type(row: _Row, class_map: ClassMap) -> str:
    """Return the first word for a type that the class map knows; else its description or name."""
    title = _strip_code(row.get("category", ""))
    texts = [row.get("description", ""), row.get("name", ""), title]
    words = (word for text in texts for word in (text, _find_noun(text)) if word)
    known = (word for word in words if class_map.classify(word).category not in (None, UNKNOWN))
    return next(known, texts[0] or texts[1])


def _find_noun(text: str) -> str:
    """Return what a name says first: `Cabinet` of `Cabinet-915 x 610`, `Chair` of `M_Chair-A`."""
    pieces = (piece.strip() for piece in _ENDS.split(text))
    return next((piece for piece in pieces if piece.casefold() not in _PREFIXES), "")


ROW = SourceRow(
    summary="COBie spreadsheets of buildings: spaces, their kinds and areas, and equipment",
    open=_CobieSheets,
    terms=None,  # a spreadsheet belongs to the owner of its building
    class_map="cobie45-v1",
)
