from __future__ import annotations

import csv
import gzip
import io
import random
import unicodedata
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pandas as pd
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet as pq
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.checks.graphs import find_faults
from bsg_data.dataset.manifest import CARD
from bsg_data.dataset.scenes import make_tables
from bsg_data.errors import SourceError
from bsg_data.scene.class_map import load_class_map
from bsg_data.scene.scene_graph import Box, Edge, SceneGraph
from bsg_data.sources.catalogue import open_source, parse_options
from bsg_data.testing import SourceContract

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
    source, class_map = open_source("table", path), load_class_map()
    return {ref.scene_id: source.read(ref, class_map).graph for ref in source.find().scenes}


def test_a_table_worked_out_by_hand(tmp_path: Path) -> None:
    graphs = read_all(write_table(tmp_path, *ROWS))
    flat, house = graphs.values()
    assert list(find_faults(make_tables([flat], load_class_map().classes))) == []
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


@settings(max_examples=20)
@given(st.randoms())
def test_the_order_of_rows_does_not_matter(
    tmp_path_factory: pytest.TempPathFactory, chance: random.Random
) -> None:
    rows = list(ROWS)
    chance.shuffle(rows)
    ordered = write_table(tmp_path_factory.mktemp("a"), *ROWS)
    shuffled = write_table(tmp_path_factory.mktemp("b"), *rows)
    assert read_all(ordered) == read_all(shuffled)


GIVEN = {"licence": "CC-BY-4.0", "homepage": "https://example.org", "citation": "Doe, 2026"}


def test_a_users_table_has_the_users_terms_or_none(tmp_path: Path) -> None:
    path = write_table(tmp_path, *ROWS)
    assert open_source("table", path).terms is None
    terms = open_source("table", path, **GIVEN).terms
    assert terms is not None
    assert terms.licence_url == "https://spdx.org/licenses/CC-BY-4.0.html"
    manifest = build_dataset(open_source("table", path, **GIVEN), tmp_path / "dataset")
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
    ],
)
def test_half_of_the_terms_are_refused(tmp_path: Path, options: dict[str, str], code: str) -> None:
    with refuses(SourceError, code):
        open_source("table", write_table(tmp_path, *ROWS), **options)


# What users bring

Rows = Sequence[dict[str, Any]]


def write_everywhere(folder: Path, rows: Rows) -> list[Path]:
    """Write the same rows as CSV, TSV, both packed, and parquet with the types of the values."""
    columns = list(dict.fromkeys(name for row in rows for name in row))
    paths = []
    for suffix, separator in (("csv", ","), ("tsv", "\t")):
        text = io.StringIO()
        writer = csv.writer(text, delimiter=separator)
        writer.writerows([columns, *([row.get(name) for name in columns] for row in rows)])
        data = text.getvalue().encode()
        for name, content in ((f"t.{suffix}", data), (f"t.{suffix}.gz", gzip.compress(data))):
            (folder / name).write_bytes(content)
            paths.append(folder / name)
    table = pa.table({name: [row.get(name) for row in rows] for name in columns})
    pq.write_table(table, folder / "t.parquet")
    return [*paths, folder / "t.parquet"]


def answer(path: Path, **options: str) -> tuple[object, ...]:
    """Return the graphs and notes of a table, or how it was refused."""
    try:
        notes = open_source("table", path, **options).find().unused
        source, class_map = open_source("table", path, **options), load_class_map()
        graphs = [source.read(ref, class_map).graph for ref in source.find().scenes]
        return (*graphs, *(note.reason for note in notes))
    except SourceError as error:
        return (error.code,)


def read_everywhere(folder: Path, rows: Rows) -> tuple[list[SceneGraph], list[str]]:
    """Return the graphs and the notes, which are the same in every kind of file."""
    first, *others = [answer(path) for path in write_everywhere(folder, rows)]
    assert others == [first] * len(others)
    graphs = [item for item in first if isinstance(item, SceneGraph)]
    return graphs, [item for item in first if isinstance(item, str)]


def in_rooms(names: Sequence[object]) -> Rows:
    return [{"scene": "a", "room": name, "category": "bed"} for name in names]


NAMES = ["a", "hall", "ha  ll", "K\u00fcche", "Ku\u0308che", "nan", "1.0"]
NUMBERS = st.sampled_from([1.0, 3.0, 12.0, 2.5, None])
WORDS = st.one_of(st.sampled_from([*NAMES, None]), st.text("aB\u00e9 \u0301\u200b", max_size=3))


@st.composite
def tables(draw: st.DrawFn) -> Rows:
    """Draw rows as programs write them: a column has one type."""
    kinds = {
        "scene": draw(st.sampled_from([st.sampled_from(["a", "b", "1.0"]), NUMBERS])),
        "room": draw(st.sampled_from([WORDS, NUMBERS, st.integers(0, 3)])),
        "category": st.sampled_from(["bed", "b\u00e9d", "be\u0301d", "chair"]),
        "count": st.sampled_from([None, 0, 1, 3]),
        "floor_area": st.sampled_from([None, 6.5]),
        "connected": draw(st.sampled_from([st.none(), st.sampled_from([None, "hall;ha ll", "1"])])),
        "x": draw(st.sampled_from([st.none(), st.sampled_from([0.1, 1e-7])])),
    }
    rows = draw(st.lists(st.fixed_dictionaries(kinds), min_size=1, max_size=8))
    return [{**row, "y": row["x"], "z": row["x"]} for row in rows]


@settings(max_examples=50)
@given(tables())
def test_the_same_rows_are_the_same_scenes_in_every_kind_of_file(
    tmp_path_factory: pytest.TempPathFactory, rows: Rows
) -> None:
    read_everywhere(tmp_path_factory.mktemp("a"), rows)


@pytest.mark.parametrize(
    ("names", "rooms"),
    [
        ([3.0, 12.0, None], [(3, None), (12, None)]),
        (["3.0", "12.000", "", "3"], [(3, None), (12, None)]),
        (["1.0", "2.5"], [(0, "1.0"), (1, "2.5")]),
        (["3.0", "hall"], [(0, "3.0"), (1, "hall")]),
        (["1e3", "3.50", "2.10"], [(0, "1e3"), (1, "2.10"), (2, "3.50")]),
        (["7", "3"], [(3, None), (7, None)]),
        (["room 10", "room 9"], [(0, "room 9"), (1, "room 10")]),
        (["1", "01"], [(0, None), (1, None)]),  # two rooms, so no numbers
        (["9999999999"], [(0, "9999999999")]),  # no number of a region
        (["²", "a1b"], [(0, "a1b"), (1, "²")]),
    ],
)
def test_rooms_are_numbered_by_their_names_and_whole_numbers_are_names(
    tmp_path: Path, names: list[Any], rooms: list[tuple[int, str | None]]
) -> None:
    ((graph,), _) = read_everywhere(tmp_path, in_rooms(names))
    assert [(room.region_id, room.source_label) for room in graph.rooms] == rooms


def test_what_pandas_reads_as_missing_is_missing(tmp_path: Path) -> None:
    for word in {*pd._libs.parsers.STR_NA_VALUES, "NaT"} - {""}:  # type: ignore[attr-defined]
        rows: Rows = [*in_rooms([word, "hall"]), {"scene": "a", "room": "bath", "category": word}]
        ((graph,), _) = read_everywhere(tmp_path, rows)
        assert [room.source_label for room in graph.rooms] == ["bath", "hall"]
        assert [obj.room_index for obj in graph.objects] == [0, 2]


def test_a_name_is_one_name_in_every_unicode_form(tmp_path: Path) -> None:
    composed, parted = (unicodedata.normalize(form, "Küche") for form in ("NFC", "NFD"))
    ((graph,), _) = read_everywhere(tmp_path, in_rooms([composed, f" {parted} ", "hall"]))
    assert [room.source_label for room in graph.rooms] == [composed, "hall"]


def test_columns_have_the_users_names(tmp_path: Path) -> None:
    table = ["building_id,Room ,label,N,scene", "a,hall,bed,2,x", "a,bath,sink,,x"]
    path = write_table(tmp_path, *table[1:], header=table[0])
    words = {"scene": "building_id", "category": "label", "count": "n"}
    source = open_source("table", path, **parse_options("table", words))
    manifest = build_dataset(source, tmp_path / "dataset")
    assert manifest.sources[0].options == words
    assert [note.reason for note in manifest.left_out] == ["columns that are not read: scene"]
    assert (manifest.totals.scenes, manifest.totals.objects) == (1, 3)
    assert check_dataset(tmp_path / "dataset") == ()
    with refuses(SourceError, "column-missing", path):
        open_source("table", path, scene="bulding_id").find()


def test_a_row_of_n_objects_is_n_rows(tmp_path: Path) -> None:
    few: Rows = [
        {"scene": "a", "room": "hall", "category": "chair", "count": 3.0},
        {"scene": "a", "room": "bath", "category": "bed", "count": 0.0},
        {"scene": "a", "room": None, "category": "lamp", "count": None},
        {"scene": "a", "room": None, "category": "rug", "count": 0.0},
    ]
    (graph,), _ = read_everywhere(tmp_path, few)
    many = ["a,hall,chair", "a,bath,", "a,hall,chair", "a,,lamp", "a,hall,chair"]
    path = write_table(tmp_path, *many, header="scene,room,category")
    assert graph == read_all(path)["a"]


UNREAD = "columns that are not read: "


@pytest.mark.parametrize(
    ("text", "notes"),
    [
        (
            "\ufeffscene,room,category,,\r\na,1,bed,,\r\n,,,,\r\n\r\n",
            [UNREAD + "(no name), (no name)"],
        ),
        ("Scene, ROOM ,category\na,1,bed\n", []),
        ("scene,room,category\ra,1,bed\r", []),
        ("scene,room,category,note,note\na,1,bed,x,y\n", [UNREAD + "note, note"]),
        ("scene,SCENE,room,category\na,b,1,bed\n", [UNREAD + "SCENE"]),
        ('scene,room,category,memo\na,1,bed,"two\nlines"\n', [UNREAD + "memo"]),
        (
            "scene,room,category\na,1,bed\nscene,room,category\n",
            ["rows that repeat the header, left out: 1"],
        ),
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_odd_tables_that_say_the_same(
    tmp_path: Path, text: str, notes: list[str], encoding: str
) -> None:
    (tmp_path / "t.csv").write_bytes(
        text.removeprefix("\ufeff" * (encoding != "utf-8")).encode(encoding)
    )
    plain = write_table(tmp_path, "a,1,bed", header="scene,room,category")
    assert answer(tmp_path / "t.csv") == (*answer(plain), *notes)


def test_text_of_parquet_may_be_bytes_and_dictionaries_but_no_lists(tmp_path: Path) -> None:
    columns = {
        "scene": pa.array([b"a", b"a"]),
        "room": pa.array(["Küche", "hall"]).dictionary_encode(),
        "category": pa.array(["bed", None], pa.large_string()),
        "connected": ["hall;nan", None],
    }
    pq.write_table(pa.table(columns), tmp_path / "t.parquet")
    rows = ["a,Küche,bed,hall;nan", "a,hall,,"]
    path = write_table(tmp_path, *rows, header="scene,room,category,connected")
    assert answer(tmp_path / "t.parquet") == answer(path)
    columns["connected"] = [["hall", None], []]
    pq.write_table(pa.table(columns), tmp_path / "t.parquet")
    with refuses(SourceError, "table-lists", tmp_path / "t.parquet"):
        open_source("table", tmp_path / "t.parquet").find()


def test_what_is_left_out_is_counted(tmp_path: Path) -> None:
    rows = [
        "scene,room,category,count",
        "a,hall,chair,1",
        "a,,chair,0",
        "a,NA,table,",
        "a,hall,NA,",
    ]
    (tmp_path / "t.csv").write_text("\n".join([*rows, rows[0], rows[0], ""]), "utf-8")
    notes = open_source("table", tmp_path / "t.csv").find().unused
    assert [note.reason for note in notes] == [
        "cells that say NA, read as empty: 2",
        "rows of no object and no room (count is 0), left out: 1",
        "rows that repeat the header, left out: 2",
    ]
