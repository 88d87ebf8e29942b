from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import openpyxl
import pytest
from refusals import refuses

from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.room_label import label_of
from bsg_data.sources.catalogue import open_source
from bsg_data.sources.source import Reading
from bsg_data.testing import SourceContract

SHEETS: dict[str, list[list[Any]]] = {
    "Facility": [["Name", "Category", "AreaUnits"], ["F", "11-13 24 14: Clinic", "square feet"]],
    "Floor": [["Name", "Elevation"], ["Upper", 3.5], ["Ground", 0], ["Roof", 9]],
    "Space": [
        ["NAME", "Category", "Floor Name", "Description", "Net Area", "GrossArea"],
        [101, "13-41 11 14 21: Restroom", "Ground", "W. TOILET", 100, "n/a"],
        ["102", "13-41 41 99: Other Healing Spaces", "upper", "EXAM ROOM 2", "n/a", 200],
        ["A, B", "n/a", "Attic", "N/A", None, None],
        [None] * 6,
        ["102", "13-85 11 11: Corridor", "Upper", "twice", 1, 1],
    ],
    "Type": [
        ["Name", "Description", "Category"],
        ["Equip-1", "Chair with Arms", "n/a"],
        ["M_Toilet-Domestic-3D: 610", "n/a", "n/a"],
        ["C18", "0600x1200", "23-80 70: General Luminaries, Non Directional"],
        ["Door Type A", "Flush wood - 0915 x 2134mm", "23-30 10: Doors"],
        ["X9", "gizmo", "n/a"],
    ],
    "Component": [
        ["Name", "TypeName", "Space", "Description"],
        ["c1", "Equip-1", 101, None],
        ["c2", "M_Toilet-Domestic-3D: 610", "101", None],
        ["c3", "C18", "A, B", None],
        ["c4", "Door Type A", "101, 102", None],
        ["c5", "X9", "999", None],
        ["c6", "nothing", "n/a", "Mirror 600mm x 900mm"],
    ],
}


def write_book(path: Path, sheets: Mapping[str, Sequence[Sequence[Any]]] = SHEETS) -> Path:
    book = openpyxl.Workbook()
    for name, rows in sheets.items():
        sheet = book.create_sheet(name)
        for row in rows:
            sheet.append(row)
    book.save(path)
    return path


def read(path: Path) -> Reading:
    source = open_source("cobie", path)
    (ref,) = source.find().scenes
    return source.read(ref, load_class_map("cobie45-v1"))


class TestCobie(SourceContract):
    name = "cobie"

    def write_example(self, folder: Path) -> Path:
        write_book(folder / "clinic.xlsx")
        write_book(folder / "office.xlsx", {"Space": [["Name"], ["1"]]})
        return folder


def test_a_building_with_its_rooms_and_their_equipment(tmp_path: Path) -> None:
    reading = read(write_book(tmp_path / "clinic.xlsx"))
    graph = reading.graph
    foot = 0.3048**2
    assert graph.building_kind == "clinic"
    assert [
        (r.source_label, r.label, r.floor_index, r.floor_area and round(r.floor_area / foot))
        for r in graph.rooms
    ] == [
        ("Restroom", "toilet", 0, 100),
        ("EXAM ROOM 2", "examination room", 1, 200),
        ("A, B", None, None, None),
    ]
    assert [(o.room_index, o.raw_category, o.category, o.role) for o in graph.objects] == [
        (1, "Chair with Arms", "chair", "classified"),
        (1, "Toilet", "toilet", "classified"),
        (3, "General Luminaries, Non Directional", "light fixture", "classified"),
        (1, "Door", "door", "structure"),
        (0, "gizmo", None, "unmapped"),
        (0, "Mirror", "mirror", "classified"),
    ]
    assert [(edge.source, edge.target, edge.method) for edge in graph.adjacency] == [(1, 2, "door")]


def test_what_refers_to_nothing_is_counted(tmp_path: Path) -> None:
    reading = read(write_book(tmp_path / "clinic.xlsx"))
    assert [skip.reason for skip in reading.left_out] == [
        "1 spaces have no name or that of an earlier one of their floor: they are left out",
        "1 spaces are on a floor without an elevation: their level is not known",
        "1 names of spaces of components are not in the sheet Space",
        "1 components have no type in the sheet Type: their own words name them",
        "1 components name no space: they belong to the building",
    ]


# Words that say something, though pieces of them say nothing.
KEPT = ["Nail bar", "None of yours", "Unknown soldier's chapel", "-1", "0", "Tba-lab 3", "Ref"]


def list_rooms(path: Path, *rows: Sequence[Any]) -> list[tuple[str, str | None]]:
    """Return word and label of spaces with name, category, description and tag, as Revit has."""
    header = ["Name", "Category", "FloorName", "Description", "RoomTag"]
    space = [header, *([name, kind, "n/a", text, tag] for name, kind, text, tag in rows)]
    rooms = read(write_book(path, {"Space": space})).graph.rooms
    return [(room.source_label, room.label) for room in rooms]


def test_the_tag_of_a_room_is_the_last_to_say_what_it_is(tmp_path: Path) -> None:
    other = "13-11 11: Restroom"
    assert list_rooms(
        tmp_path / "b.xlsx",
        ["1", "Not Found", "n/a", "Corridor 1"],
        ["2", other, "n/a", "Corridor 2"],
        ["3", None, "Kitchen", "Corridor 3"],
        ["Office", None, None, "Corridor 4"],
        ["5", "13-99: Not Found", "Hatch of Zorg", "Corridor 5"],
        ["6", None, None, "T-6"],
        ["7", None, None, "Bastelraum"],
        *([name, None, None, None] for name in KEPT),
    ) == [
        ("Corridor", "corridor"),
        ("Restroom", "toilet"),
        ("Kitchen", "kitchen"),
        ("Office", "office"),
        ("Corridor", "corridor"),
        ("6", None),
        ("Bastelraum", None),  # which the report names as unknown, and not the number
        *((word, label_of("cobie", word)) for word in KEPT),
    ]


SILENT = ["NOT_FOUND", "N.A.", "#REF!", "tbc", "Not applicable", "n/a : n/a", "<unknown>", "-", "?"]


@pytest.mark.parametrize("word", SILENT)
def test_a_word_that_says_nothing_is_an_empty_cell_in_every_column(
    tmp_path: Path, word: str
) -> None:
    def reading(no: str | None) -> Reading:
        sheets = {
            "Facility": [["Name", "Category", "AreaUnits"], ["F", no, no]],
            "Floor": [["Name", "Elevation"], ["G", no], [no, 3]],
            "Space": [
                ["Name", "Category", "FloorName", "Description", "RoomTag", "NetArea", "GrossArea"],
                ["1", no, no, no, "Kitchen", no, 9],
                [no, "13-11: Office", "G", "Office", no, 1, 1],
            ],
            "Type": [["Name", "Description", "Category"], ["t", no, "23-40: Chair"]],
            "Component": [
                ["Name", "TypeName", "Space", "Description"],
                ["c", "t", no, "Chair"],
                ["d", no, "1", "Mirror"],
            ],
        }
        return read(write_book(tmp_path / "b.xlsx", sheets))

    silent, empty = reading(word), reading(None)
    assert (silent.graph.rooms, silent.graph.objects) == (empty.graph.rooms, empty.graph.objects)
    assert silent.left_out == empty.left_out
    (kitchen,) = silent.graph.rooms
    assert (kitchen.source_label, kitchen.floor_area) == ("Kitchen", 9)


@pytest.mark.parametrize(
    ("unit", "cell", "area", "why"),
    [
        *((unit, 100, 100, "") for unit in ("squaremeters", "Square Metres", "sq. m")),
        ("sq ft", 100, 9.290304, ""),
        *((unit, 100, None, "unknown unit") for unit in ("tatami", "square millimeters")),
        *(("m2", cell, None, "no possible number") for cell in ("12,5", -5, 1e300, 0)),
    ],
)
def test_an_area_that_cannot_be_is_left_out_and_counted(
    tmp_path: Path, unit: str, cell: object, area: float | None, why: str
) -> None:
    sheets = {"Facility": [["AreaUnits"], [unit]], "Space": [["Name", "NetArea"], ["a", cell]]}
    reading = read(write_book(tmp_path / "b.xlsx", sheets))
    assert reading.graph.rooms[0].floor_area == (area if area is None else pytest.approx(area))
    assert [why in skip.reason for skip in reading.left_out if "area" in skip.reason] == (
        [True] * (area is None)
    )


def test_an_empty_cell_in_the_last_row_says_nothing(tmp_path: Path) -> None:
    """Programs write one where somebody formatted a whole column."""
    book = openpyxl.Workbook()
    book.active.title = "Space"
    book.active.append(["Name"])
    book.active.append(["1"])
    book.active["C1048576"].number_format = "0.00"
    book.active["XFD1048576"].number_format = "0.00"
    book.save(tmp_path / "b.xlsx")
    assert [room.source_label for room in read(tmp_path / "b.xlsx").graph.rooms] == ["1"]


def test_sheets_that_are_missing_or_empty(tmp_path: Path) -> None:
    reading = read(write_book(tmp_path / "b.xlsx", {"space ": SHEETS["Space"], "Type": []}))
    assert (len(reading.graph.rooms), reading.graph.objects) == (3, ())
    assert reading.graph.rooms[0].floor_area == 100
    assert any("it is read as m²" in skip.reason for skip in reading.left_out)
    with refuses(SourceError, "sheet-missing"):
        read(write_book(tmp_path / "b.xlsx", {"Component": SHEETS["Component"]}))


def test_spaces_of_one_name_on_two_floors_are_two_rooms_and_their_things_in_none(
    tmp_path: Path,
) -> None:
    space = [["Name", "FloorName", "Description"], ["107", "G", "Kitchen"], ["107", "1", "Bedroom"]]
    component = [["Name", "Space", "Description"], ["c", "107", "Bed"], ["d", "107", "Mirror"]]
    reading = read(write_book(tmp_path / "b.xlsx", {"Space": space, "Component": component}))
    assert [room.label for room in reading.graph.rooms] == ["kitchen", "bedroom"]
    assert [obj.room_index for obj in reading.graph.objects] == [0, 0]
    said = "2 components are in 107, as spaces of several floors are called: in no room"
    assert said in [skip.reason for skip in reading.left_out]
