from __future__ import annotations

import random
from pathlib import Path

import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import CARD
from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box, Edge, SceneGraph
from bsg_data.sources.table import ObjectTable, number_rooms
from bsg_data.testing import SourceContract, require_whole

HEADER = (
    "scene,room,category,room_label,floor,floor_area,connected,x,y,z,"
    "box_min_x,box_min_y,box_min_z,box_max_x,box_max_y,box_max_z,colour"
)
ROWS = (
    "flat,hall,,corridor,1,6.5,bath;kitchen,,,,,,,,,,",
    "flat,kitchen,stove,,1,,,,,,0,0,0,1,1,1,white",
    "flat,kitchen,chair,,,,,3,1,0.5,,,,,,,red",
    "flat,bath,toilet,,-1,,,5,2,0.4,,,,,,,",
    "flat,bath,toilet,,,,,5,2,0.4,,,,,,,",
    "flat,,painting,,,,,,,,,,,,,,",
    "house,12,bed,bedroom,,,,,,,,,,,,,",
)


def write_table(folder: Path, *rows: str, header: str = HEADER) -> Path:
    path = folder / "objects.csv"
    path.write_text("\n".join([header, *rows]) + "\n", "utf-8")
    return path


class TestTable(SourceContract):
    name = "table"

    def write_example(self, folder: Path) -> Path:
        return write_table(folder, *ROWS)


def read_all(path: Path) -> dict[str, SceneGraph]:
    source, class_map = ObjectTable(path), load_class_map()
    return {ref.scene_id: source.read(ref, class_map).graph for ref in source.find().scenes}


def test_a_table_worked_out_by_hand(tmp_path: Path) -> None:
    graphs = read_all(write_table(tmp_path, *ROWS))
    flat, house = graphs.values()
    require_whole(flat)
    bath, hall, kitchen = flat.rooms
    assert [(r.region_id, r.source_label, r.label, r.floor_index) for r in flat.rooms] == [
        (0, "bath", "bathroom", 0),
        (1, "corridor", "corridor", 1),
        (2, "kitchen", "kitchen", 1),
    ]
    assert (hall.floor_area, hall.centroid, hall.box) == (6.5, None, None)
    assert (bath.centroid, bath.box, bath.footprint) == ((5, 2, 0.4), None, None)
    assert kitchen.box == Box((0, 0, 0), (3, 1, 1))
    assert kitchen.centroid == (1.5, 0.5, 0.5)
    assert kitchen.footprint == ((0, 0), (3, 0), (3, 1), (0, 1))
    assert kitchen.floor_z == 0
    assert [(o.raw_category, o.room_index, o.centroid) for o in flat.objects] == [
        ("painting", 0, None),
        ("toilet", 1, (5, 2, 0.4)),
        ("toilet", 1, (5, 2, 0.4)),
        ("chair", 3, (3, 1, 0.5)),
        ("stove", 3, (0.5, 0.5, 0.5)),
    ]
    assert flat.adjacency == (
        Edge(1, 2, "adjacent", "given"),
        Edge(2, 3, "adjacent", "given"),
    )
    assert [(r.region_id, r.source_label, r.label) for r in house.rooms] == [
        (12, "bedroom", "bedroom")
    ]


def test_columns_that_are_not_read_are_reported_once(tmp_path: Path) -> None:
    path = write_table(tmp_path, *ROWS)
    (note,) = ObjectTable(path).find().unused
    assert (note.location, note.reason) == ("objects.csv", "columns that are not read: colour")
    manifest = build_dataset(ObjectTable(path), tmp_path / "dataset")
    assert [skip.reason for skip in manifest.left_out] == [note.reason]
    assert check_dataset(tmp_path / "dataset") == ()


@given(st.randoms())
def test_the_order_of_rows_does_not_matter(
    tmp_path_factory: pytest.TempPathFactory, chance: random.Random
) -> None:
    rows = list(ROWS)
    chance.shuffle(rows)
    one = write_table(tmp_path_factory.mktemp("a"), *ROWS)
    other = write_table(tmp_path_factory.mktemp("b"), *rows)
    assert read_all(one) == read_all(other)


def test_parquet_gives_the_same_graphs(tmp_path: Path) -> None:
    path = write_table(tmp_path, *ROWS)
    pq.write_table(pyarrow.csv.read_csv(path), tmp_path / "objects.parquet")
    assert read_all(tmp_path / "objects.parquet") == read_all(path)


def test_three_columns_are_enough(tmp_path: Path) -> None:
    graphs = read_all(write_table(tmp_path, "a,1,chair", "a,2,", header="scene,room,category"))
    (graph,) = graphs.values()
    assert len(graph.rooms) == 2
    assert [(r.source_label, r.centroid, r.floor_index) for r in graph.rooms] == [
        (None, None, None)
    ] * 2


@pytest.mark.parametrize(
    ("names", "regions"),
    [
        (["7", "3"], {"3": 3, "7": 7}),
        (["room 10", "room 9"], {"room 9": 0, "room 10": 1}),
        (["1", "01"], {"01": 0, "1": 1}),  # two rooms, so no numbers
        (["kitchen", "2"], {"2": 0, "kitchen": 1}),
        (["9999999999"], {"9999999999": 0}),  # no number of a region
        (["²", "a1b"], {"a1b": 0, "²": 1}),
        ([], {}),
    ],
)
def test_numbers_of_rooms(names: list[str], regions: dict[str, int]) -> None:
    assert number_rooms(names) == regions


@pytest.mark.parametrize(
    ("row", "expected"),
    [
        ("../up,1,bed,,,,,,,,,,,,,,", "column scene: expected a name that a file can have"),
        ("a,,,,,,,,,,,,,,,,", "column category: expected an object, or a room"),
        ("a,1,bed,,1.5,,,,,,,,,,,,", "column floor: expected a whole number"),
        ("a,1,bed,,0,0,,,,,,,,,,,", "column floor_area: expected square metres above 0"),
        ("a,1,bed,,,,,1,2,,,,,,,,", "column z: expected a number, as in the rest of x, y, z"),
        ("a,1,bed,,,,,1e9,2,1,,,,,,,", "column x: expected a number from -10000 to 10000"),
        ("a,1,bed,,,,,,,,0,0,0,,,,", "column box_max_x: expected both corners"),
        ("a,1,bed,,,,,,,,0,0,1,1,1,0,", "column box_max_z: expected 1.0 or more"),
        ("a,1,bed,,,,,2,0,0,0,0,0,1,1,1,", "column x: expected a number in the box"),
        ("a,1,,,,,,2,0,0,,,,,,,", "column category: expected the object whose centroid"),
        ("a,,bed,,0,,,,,,,,,,,,", "column floor: expected nothing where the row has no room"),
        ("a,,bed,,,,b,,,,,,,,,,", "column connected: expected nothing where"),
        ("a,1,bed,,,,1,,,,,,,,,,", "column connected: .* found '1', itself"),
        ("a,1,bed,,,,2,,,,,,,,,,", "column connected: .* found '2', a room that no row has"),
        ("a,0,bed,kitchen,,,,,,,,,,,,,", "column room_label: expected 'bath' for room '0'"),
        (f"a,1,{'b' * 201},,,,,,,,,,,,,,", "column category: expected at most 200 characters"),
    ],
)
def test_a_malformed_row_is_named_by_line_and_column(
    tmp_path: Path, row: str, expected: str
) -> None:
    path = write_table(tmp_path, "a,0,bed,bath,,,,,,,,,,,,,", row)
    with pytest.raises(SourceError, match=f"objects.csv.*, line 3, {expected}"):
        ObjectTable(path).find()


@pytest.mark.parametrize(
    ("header", "expected"),
    [
        ("scene;room;category", "separated by semicolons"),
        ("scene,room,Category", "no column 'category'; is 'Category' meant"),
        (
            "scene,room",
            "no column 'category'. Expected scene, room, category, in small letters, and any of",
        ),
        ("scene,room,category,x,y", "no column 'z'; expected all of x, y, z, or none"),
        ("scene,room,category,box_min_x", "no column 'box_min_y'"),
        ("scene,room,category", "holds no row"),
    ],
)
def test_a_table_without_its_columns_or_rows(tmp_path: Path, header: str, expected: str) -> None:
    with pytest.raises(SourceError, match=expected):
        ObjectTable(write_table(tmp_path, header=header)).find()


GIVEN = {"licence": "CC-BY-4.0", "homepage": "https://example.org", "citation": "Doe, 2026"}


def test_a_users_table_has_the_users_terms_or_none(tmp_path: Path) -> None:
    path = write_table(tmp_path, *ROWS)
    assert ObjectTable(path).terms is None
    terms = ObjectTable(path, **GIVEN).terms
    assert terms is not None
    assert terms.licence_url == "https://spdx.org/licenses/CC-BY-4.0.html"
    manifest = build_dataset(ObjectTable(path, **GIVEN), tmp_path / "dataset")
    assert manifest.sources[0].terms == terms
    card = (tmp_path / "dataset" / CARD).read_text("utf-8")
    assert "license: cc-by-4.0" in card
    assert "Doe, 2026" in card
    assert "matterport" not in card.casefold()


@pytest.mark.parametrize(
    ("options", "expected"),
    [
        ({"licence": "MIT"}, "homepage and citation missing"),
        ({**GIVEN, "homepage": "example.org"}, "homepage: expected an address"),
        ({**GIVEN, "licence": "CC BY"}, "expected an SPDX identifier"),
        ({**GIVEN, "licence": "LicenseRef-mine"}, "give licence_url"),
        ({"licence_url": "https://example.org"}, "licence and homepage and citation missing"),
    ],
)
def test_half_of_the_terms_are_refused(
    tmp_path: Path, options: dict[str, str], expected: str
) -> None:
    with pytest.raises(SourceError, match=expected):
        ObjectTable(write_table(tmp_path, *ROWS), **options)
