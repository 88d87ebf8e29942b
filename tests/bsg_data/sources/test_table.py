from __future__ import annotations

import gzip
import random
from pathlib import Path

import pandas as pd
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

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
    assert (kitchen.floor_z, kitchen.floor_area) == (0, 3)
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


def test_three_columns_are_enough(tmp_path: Path) -> None:
    graphs = read_all(write_table(tmp_path, "a,1,chair", "a,2,", header="scene,room,category"))
    (graph,) = graphs.values()
    found = [(r.source_label, r.centroid, r.floor_index) for r in graph.rooms]
    assert found == [(None, None, None)] * 2


@pytest.mark.parametrize(
    ("names", "regions"),
    [
        (["7", "3"], {"3": 3, "7": 7}),
        (["room 10", "room 9"], {"room 9": 0, "room 10": 1}),
        (["1", "01"], {"01": 0, "1": 1}),  # two rooms, so no numbers
        (["9999999999"], {"9999999999": 0}),  # no number of a region
        (["²", "a1b"], {"a1b": 0, "²": 1}),
        ([], {}),
    ],
)
def test_numbers_of_rooms(names: list[str], regions: dict[str, int]) -> None:
    assert number_rooms(names) == regions


@pytest.mark.parametrize(
    "row",
    [
        "../up,1,bed,,,,,,,,,,,,,,",
        "a,,,,,,,,,,,,,,,,",
        "a,1,bed,,1.5,,,,,,,,,,,,",
        "a,1,bed,,,,,1,2,,,,,,,,",
        "a,1,bed,,,,,,,,0,0,1,1,1,0,",
        "a,1,bed,,,,,2,0,0,0,0,0,1,1,1,",
        "a,,bed,,0,,,,,,,,,,,,",
        f"a,1,{'b' * 201},,,,,,,,,,,,,,",
        "a,1,bed,,,,,nan,2,1,,,,,,,",
    ],
)
def test_a_malformed_row_is_named_by_its_line(tmp_path: Path, row: str) -> None:
    path = write_table(tmp_path, "a,0,bed,bath,,,,,,,,,,,,,", row)
    with refuses(SourceError, "row-malformed", f"{path}, line 3"):
        ObjectTable(path).find()


@pytest.mark.parametrize(
    ("row", "code"),
    [
        ("a,1,bed,,,,1,,,,,,,,,,", "room-unknown"),
        ("a,1,bed,,,,2,,,,,,,,,,", "room-unknown"),
        ("a,0,bed,kitchen,,,,,,,,,,,,,", "rows-disagree"),
    ],
)
def test_rows_that_do_not_agree_are_named(tmp_path: Path, row: str, code: str) -> None:
    path = write_table(tmp_path, "a,0,bed,bath,,,,,,,,,,,,,", row)
    with refuses(SourceError, code, f"{path}: scene a, line 3"):
        ObjectTable(path).find()


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (b"", "column-missing"),
        (b"scene;room;category\n", "column-missing"),
        (b"scene,room,category,x,y\n", "column-missing"),
        (b"scene,room,category,scene\n", "column-twice"),
        (b"scene,room,category\n", "source-empty"),
        (b"scene,room,category\na,1\n", "row-ragged"),
        (b'scene,room,category\na,1,"bed\n', "csv-malformed"),
        (b"scene,room,category\na,1,\xff\n", "csv-malformed"),
    ],
)
def test_a_file_that_is_no_table_is_refused(tmp_path: Path, text: bytes, code: str) -> None:
    path = tmp_path / "objects.csv"
    path.write_bytes(text)
    with refuses(SourceError, code):
        ObjectTable(path).find()


def test_the_same_rows_in_every_kind_of_file(tmp_path: Path) -> None:
    path = write_table(tmp_path, *ROWS)
    text = path.read_text("utf-8")
    (tmp_path / "packed.csv.gz").write_bytes(gzip.compress(b"\xef\xbb\xbf" + text.encode()))
    (tmp_path / "tabs.tsv").write_text(text.replace(",", "\t") + "\n\n", "utf-8")
    pq.write_table(pyarrow.csv.read_csv(path), tmp_path / "objects.parquet")
    for name in ("packed.csv.gz", "tabs.tsv", "objects.parquet"):
        assert read_all(tmp_path / name) == read_all(path)
    # Whole numbers that pandas made real are names of rooms.
    table = pd.DataFrame({"scene": "a", "room": [3, None], "category": ["bed", "door"]})
    table.to_parquet(tmp_path / "t.parquet")
    (graph,) = read_all(tmp_path / "t.parquet").values()
    assert [(room.region_id, room.source_label) for room in graph.rooms] == [(3, None)]


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
    ("options", "code"),
    [
        ({"licence": "MIT"}, "terms-missing"),
        ({**GIVEN, "licence": "CC BY"}, "terms-malformed"),
        ({**GIVEN, "licence": "LicenseRef-mine"}, "terms-missing"),
        ({"licence_url": "https://example.org"}, "terms-missing"),
    ],
)
def test_half_of_the_terms_are_refused(tmp_path: Path, options: dict[str, str], code: str) -> None:
    with refuses(SourceError, code):
        ObjectTable(write_table(tmp_path, *ROWS), **options)
