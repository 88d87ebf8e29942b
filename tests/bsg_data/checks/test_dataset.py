"""Every kind of damage is found, wherever it is."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import commit_manifest, describe_file
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.checks.scenes import repeats
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.table import ObjectTable
from bsg_data.synthetic.buildings import GeometryOptions, write_synthetic


def edit(dataset: Path, file: str, change: Callable[[pd.DataFrame], pd.DataFrame]) -> None:
    """Change a table by hand and make the manifest agree, so that only the rows can tell."""
    listed = (entry.path for entry in read_manifest(dataset).files)
    file = next(name for name in listed if name.startswith(file) and "val" not in name)
    path = dataset / file
    table = pq.read_table(path)
    frame = change(table.to_pandas())
    edited = pa.Table.from_pandas(frame, schema=table.schema, preserve_index=False)
    pq.write_table(edited.replace_schema_metadata(table.schema.metadata), path)
    list_again(dataset, file, rows=len(frame))


def list_again(dataset: Path, file: str, *, rows: int) -> None:
    """Make the manifest agree with a file."""
    manifest = read_manifest(dataset)
    files = tuple(
        describe_file(dataset, file, rows=rows) if entry.path == file else entry
        for entry in manifest.files
    )
    commit_manifest(dataset, manifest.model_copy(update={"files": files}))


def setting(column: str, value: object, row: int = 0) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(frame: pd.DataFrame) -> pd.DataFrame:
        values = list(frame[column])
        values[row] = value
        return frame.assign(**{column: pd.Series(values, dtype=frame[column].dtype)})

    return change


def test_a_sound_dataset_has_no_fault(dataset: Path) -> None:
    assert check_dataset(dataset) == ()


OBJECTS = "objects/part-00000.parquet"
ROOMS = "rooms/part-00000.parquet"
SCENES = "scenes/part-00000.parquet"
EDGES = "edges/part-00000.parquet"
PAIRS, SPLITS = "pairs/", "splits/"  # found by what their names begin with
PLACES = ("scenes", "rooms", "objects", "edges", "splits", "pairs", "dataset.json")


@pytest.mark.parametrize(
    ("file", "change", "expected"),
    [
        (SCENES, setting("num_rooms", 99), "num_rooms: expected "),
        (SCENES, setting("num_classified", 1), "num_classified: expected "),
        (SCENES, setting("scene_id", "00001-abcdefghi01"), "is there twice"),
        (SCENES, setting("scene_id", "99999-abcdefghi01"), "has two scene ids"),
        (SCENES, setting("scene_id", "../secret"), "cannot be part of a file name"),
        (ROOMS, setting("room_index", 7), "room_index does not run"),
        (ROOMS, setting("scene_id", "nowhere"), "nowhere is no scene"),
        (OBJECTS, setting("room_index", 77), "room_index is not 0..R"),
        (OBJECTS, setting("class", "sofa", 4), "class is not the name of class_index"),
        (OBJECTS, setting("class_index", 200, 4), "class_index is not 0..44"),
        (OBJECTS, setting("raw_category", "toilet", 4), "class_index is not what hm3d45-v2 says"),
        (OBJECTS, setting("role", "structure", 4), "role is not what hm3d45-v2 says"),
        (OBJECTS, setting("role", "thing", 4), "role is none of"),
        (OBJECTS, setting("role", "unmapped", 4), "role: expected unmapped without a category"),
        (OBJECTS, setting("instance_id", 2), "instance_id is there twice"),
        (OBJECTS, lambda f: f.iloc[1:], "num_objects: expected "),
        (EDGES, setting("target_index", 3), "contains edges do not agree with"),
        (EDGES, setting("kind", "beside"), "'beside' is neither"),
        (EDGES, lambda f: f.iloc[[0, 0, *range(1, len(f))]], "is there twice"),
        (EDGES, lambda f: f.iloc[::-1], "rows of other scenes, or in another order"),
        (SCENES, lambda f: f.iloc[::-1], "is not sorted by scene_id"),
        (ROOMS, setting("region_id", -7), "region_id does not rise"),
        (OBJECTS, setting("colour", "red"), "colour is not RRGGBB"),
        (OBJECTS, setting("has_geometry", True), "has_geometry does not agree with the box"),
        (OBJECTS, setting("room_index", -1), "room_index is not 0..R"),
        (PAIRS, setting("visited", False, 1), "is not the mask of its recipe"),
        (SPLITS, setting("split", "training"), "found training"),
        (SPLITS, lambda f: f.assign(split="train"), ": expected split "),
        (SPLITS, lambda f: f.iloc[1:], "not in both scenes and splits"),
        (
            SPLITS,
            lambda f: pd.concat([f, f.head(1).assign(split="test")]),
            "in two splits",
        ),
        (
            SPLITS,
            lambda f: f.assign(split=f["split"].replace({"train": "val"})),
            "expected split train, found val",
        ),
        (PAIRS, setting("draw", 3), "expected draws 0..3"),
        (PAIRS, lambda f: f.iloc[:-1], "target is not the histogram of the objects table"),
        (PAIRS, lambda f: f.iloc[1:], "expected draws 0..3"),
        (PAIRS, setting("input", np.full(45, 9, np.uint16)), "input is above target"),
        (PAIRS, setting("target", np.zeros(45, np.uint16)), "target is not the histogram"),
        (PAIRS, setting("input", np.zeros(45, np.uint16), 1), "not the sum of its rooms"),
        (PAIRS, setting("hidden_share", np.float32(1.5)), "hidden_share is not from 0 to 1"),
        (PAIRS, setting("hidden_share", np.float32(1)), "shows objects where hidden_share is 1"),
        (PAIRS, setting("hidden_share", np.float32(0)), "hides objects where hidden_share is 0"),
        (PAIRS, setting("hidden_share", np.float32(0.4)), "is not the mask of its recipe"),
        (PAIRS, setting("withheld", np.ones(45, bool), 1), "shows objects of a withheld class"),
    ],
)
def test_damage_is_found(
    dataset: Path, file: str, change: Callable[[pd.DataFrame], pd.DataFrame], expected: str
) -> None:
    edit(dataset, file, change)
    faults = check_dataset(dataset)
    found = [f"{fault.where}: {fault.what}" for fault in faults]
    assert any(expected in line for line in found), found
    assert all(fault.where.startswith(PLACES) for fault in faults), found


def test_a_mask_that_hides_another_number_is_found(dataset: Path) -> None:
    def unhide(frame: pd.DataFrame) -> pd.DataFrame:
        first = (frame["scene_id"] == frame["scene_id"][0]) & (frame["draw"] == 0)
        inputs = [
            t if f else i for i, t, f in zip(frame["input"], frame["target"], first, strict=True)
        ]
        return frame.assign(input=inputs)

    edit(dataset, PAIRS, unhide)
    assert any("is not the mask of its recipe" in f.what for f in check_dataset(dataset))


def test_rows_of_a_scene_that_lie_apart_are_found(dataset: Path) -> None:
    """A scene that is whole in two places of a file is sound in each: only the gap tells."""
    paths = (entry.path for entry in read_manifest(dataset).files)
    train = next(path for path in paths if path.startswith(PAIRS) and "train" in path)
    first = pq.read_table(dataset / train)["scene_id"][0].as_py()
    edit(dataset, train, lambda f: pd.concat([f, f[f["scene_id"] == first]]))
    assert {fault.where for fault in check_dataset(dataset)} == {f"{train}, {first}"}


def test_files_that_changed_vanished_or_appeared_are_named(dataset: Path) -> None:
    (dataset / OBJECTS).write_bytes((dataset / OBJECTS).read_bytes()[:-1] + b"X")
    (dataset / ROOMS).unlink()
    (dataset / "pairs" / "notes.txt").write_text("mine")
    (dataset / "README.md").unlink()
    found = {fault.where: fault.what for fault in check_dataset(dataset)}
    assert set(found) == {ROOMS, OBJECTS, "pairs/notes.txt", "README.md"}


def test_another_schema_and_nulls_are_named(dataset: Path) -> None:
    path = dataset / SCENES
    table = pq.read_table(path)
    pq.write_table(table.drop_columns(["up_axis"]), path)
    list_again(dataset, SCENES, rows=len(table))
    assert [fault.where for fault in check_dataset(dataset)] == [SCENES]


def test_a_class_map_that_is_not_the_published_one_is_named(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    source = manifest.sources[0]
    other = source.class_map.model_copy(update={"sha256": "0" * 64})
    changed = (source.model_copy(update={"class_map": other}),)
    commit_manifest(dataset, manifest.model_copy(update={"sources": changed}))
    found = [fault.what for fault in check_dataset(dataset)]
    assert any("is not the published one" in what for what in found)


@pytest.fixture(scope="module")
def _placed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("placed")
    list(write_synthetic(folder / "places", scenes=2, seed=2, geometry=GeometryOptions()))
    build_dataset(HM3DFolder(folder / "places"), folder / "dataset")
    return folder / "dataset"


@pytest.fixture
def placed(_placed: Path, tmp_path: Path) -> Path:
    """A dataset with geometry; each test has its own copy."""
    return Path(shutil.copytree(_placed, tmp_path / "placed"))


def adjacent(column: str, value: object) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(frame: pd.DataFrame) -> pd.DataFrame:
        row = int(np.flatnonzero(frame["kind"] == "adjacent")[0])
        return setting(column, value, row)(frame)

    return change


def with_a_box(column: str, value: object) -> Callable[[pd.DataFrame], pd.DataFrame]:
    def change(frame: pd.DataFrame) -> pd.DataFrame:
        row = int(np.flatnonzero(frame["box_min_x"].notna())[0])
        return setting(column, value, row)(frame)

    return change


def without_an_end(frame: pd.DataFrame) -> pd.DataFrame:
    """Make a box of all x; where its middle is, nobody can say."""
    return with_a_box("box_max_x", np.inf)(with_a_box("box_min_x", -np.inf)(frame))


@pytest.mark.parametrize(
    ("file", "change", "expected"),
    [
        (OBJECTS, with_a_box("box_min_x", 99.0), "outside its box in x"),
        (OBJECTS, with_a_box("part_max_z", 99.0), "outside its box in z"),
        (OBJECTS, with_a_box("centroid_y", -99.0), "outside its box in y"),
        (OBJECTS, with_a_box("centroid_y", None), "only part of its centroid"),
        (OBJECTS, with_a_box("box_max_y", None), "has only part of its box"),
        (OBJECTS, with_a_box("area", 0.0), "area is not above 0"),
        (OBJECTS, with_a_box("area", np.inf), "area is not above 0"),
        (ROOMS, with_a_box("box_max_z", -99.0), "its geometry is impossible"),
        (ROOMS, with_a_box("floor_area", -1.0), "its geometry is impossible"),
        (ROOMS, with_a_box("box_min_x", None), "its geometry is impossible"),
        (ROOMS, with_a_box("footprint", [1.0, 2.0, 3.0]), "its geometry is impossible"),
        (ROOMS, with_a_box("floor_index", -1), "its geometry is impossible"),
        (ROOMS, with_a_box("box_max_x", np.inf), "its geometry is impossible"),
        (ROOMS, without_an_end, "its geometry is impossible"),
        (ROOMS, with_a_box("box_max_x", 900.0), "its geometry is impossible"),
        (ROOMS, with_a_box("footprint", [0.0, 0, 900, 0, 0, 900]), "its geometry is impossible"),
        (OBJECTS, with_a_box("box_max_x", np.inf), "its geometry is not finite"),
        (SCENES, setting("up_axis", "w"), "up_axis is none of"),
        (SCENES, setting("up_axis", None), "has a mesh in the manifest but no up_axis, or reverse"),
        (EDGES, setting("distance_m", 1.0), "another method, or a distance"),
        (EDGES, setting("method", "door"), "another method, or a distance"),
        (EDGES, adjacent("distance_m", 1.0), "unknown method or distance"),
        (SCENES, setting("has_geometry", False), "totals.placed: expected 1, found 2"),
        (EDGES, adjacent("method", "guess"), "unknown method or distance"),
        (EDGES, adjacent("distance_m", -1.0), "unknown method or distance"),
        (EDGES, adjacent("distance_m", np.inf), "unknown method or distance"),
        (EDGES, adjacent("distance_m", None), "unknown method or distance"),
        (EDGES, adjacent("source_index", 0), "must join two rooms, lower index first, once"),
        (EDGES, adjacent("source_index", 2), "must join two rooms, lower index first, once"),
        (EDGES, adjacent("target_index", 999), "must join two rooms, lower index first, once"),
        (EDGES, adjacent("target_kind", "object"), "must join two rooms, lower index first, once"),
    ],
)
def test_damaged_geometry_is_found(
    placed: Path, file: str, change: Callable[[pd.DataFrame], pd.DataFrame], expected: str
) -> None:
    assert check_dataset(placed) == ()
    edit(placed, file, change)
    found = [f"{fault.where}: {fault.what}" for fault in check_dataset(placed)]
    assert any(expected in line for line in found), found
    assert not any("box_" in line for line in found), "a fault names things, not columns"


def test_connected_rooms_without_a_place_are_sound(tmp_path: Path) -> None:
    """How far apart they are is not known, and masks explore along what connects them."""
    table = tmp_path / "objects.csv"
    rows = [f"flat{k},{r},bed,{r + 1 if r < 5 else ''}" for k in range(10) for r in range(1, 6)]
    table.write_text("\n".join(["scene,room,category,connected", *rows]), "utf-8")
    dataset = tmp_path / "dataset"
    build_dataset(ObjectTable(table), dataset)
    split_dataset(dataset, SplitRecipe())
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(strategy="explore"), draws=2))
    edges = pq.read_table(dataset / EDGES, columns=["kind"])["kind"].to_pylist()
    assert edges.count("adjacent") == 40  # the five rooms of each flat are in a row
    assert check_dataset(dataset) == ()


def test_a_coverage_that_does_not_add_up_is_found(placed: Path) -> None:
    manifest = read_manifest(placed)
    (a, first), (b, second) = manifest.meshes.items()
    meshes = {
        a: first.model_copy(update={"listed": first.listed + 1}),
        b: second.model_copy(update={"listed_area": second.listed_area + 5}),
    }
    commit_manifest(placed, manifest.model_copy(update={"meshes": meshes}))
    found = [fault.what for fault in check_dataset(placed)]
    assert any("the texels of its mesh do not add up" in what for what in found)
    assert any("the surface of its mesh does not add up" in what for what in found)


# A part at a time


@pytest.fixture(scope="module")
def _in_parts(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("in_parts")
    list(write_synthetic(folder / "buildings", scenes=10, seed=3))
    build_dataset(HM3DFolder(folder / "buildings"), folder / "dataset", scenes_per_shard=3)
    split_dataset(folder / "dataset", SplitRecipe())
    write_pairs(folder / "dataset", PairsRecipe(draws=2))
    return folder / "dataset"


@pytest.fixture
def in_parts(_in_parts: Path, tmp_path: Path) -> Path:
    """Ten buildings in four parts, split, with two draws; each test has its own copy."""
    return Path(shutil.copytree(_in_parts, tmp_path / "in_parts"))


@pytest.mark.parametrize("held", [1, 2**28])
def test_the_truth_is_the_same_however_little_of_it_is_held(
    in_parts: Path, monkeypatch: pytest.MonkeyPatch, held: int
) -> None:
    monkeypatch.setattr("bsg_data.dataset.dataset.HELD_BYTES", held)
    assert check_dataset(in_parts) == ()
    edit(in_parts, PAIRS, setting("visited", False, 1))
    assert [fault.what for fault in check_dataset(in_parts)] == [
        "is not the mask of its recipe, or another NumPy drew it"
    ]


@pytest.mark.parametrize(
    ("file", "change", "expected"),
    [
        ("scenes/part-00003.parquet", "scene", "is there twice"),
        ("scenes/part-00003.parquet", "building", "has two scene ids"),
        ("scenes/part-00002.parquet", "early", "is not sorted by scene_id"),
        ("rooms/part-00002.parquet", "scene", "part 2 has rows of other scenes"),
    ],
)
def test_scenes_of_another_part_are_known(
    in_parts: Path, file: str, change: str, expected: str
) -> None:
    first = Dataset.open(in_parts).scene_ids[0]
    value = {"scene": first, "building": "99999" + first[5:], "early": "00000-AAAAAAAAAAA"}
    edit(in_parts, file, setting("scene_id", value[change]))
    found = [f"{fault.where}: {fault.what}" for fault in check_dataset(in_parts)]
    assert any(expected in line for line in found), found
    assert not any("no scene of the dataset" in line and first in line for line in found)


def test_objects_of_all_parts_are_counted_together(in_parts: Path) -> None:
    paths = [entry.path for entry in read_manifest(in_parts).files_of("objects")]
    for path in paths:
        edit(in_parts, path, lambda frame: frame.assign(colour="red"))
    objects = sum(entry.rows for entry in read_manifest(in_parts).files_of("objects"))
    *named, more = check_dataset(in_parts)
    assert [fault.what.partition(": ")[2] for fault in named] == ["colour is not RRGGBB"] * 3
    assert more.what == f"… and {objects - 3} more: colour is not RRGGBB"


def test_a_table_with_a_part_too_few_is_named(in_parts: Path) -> None:
    manifest = read_manifest(in_parts)
    last = manifest.files_of("rooms")[-1]
    (in_parts / last.path).unlink()
    files = tuple(entry for entry in manifest.files if entry != last)
    commit_manifest(in_parts, manifest.model_copy(update={"files": files}))
    found = [fault.what for fault in check_dataset(in_parts)]
    assert any("4 of scenes, 3 of rooms, 4 of objects, 4 of edges" in what for what in found)


# Rows of a scene


@given(
    rows=st.lists(st.tuples(st.integers(0, 3), st.integers(0, 3), st.integers(0, 2)), max_size=30)
)
def test_repeats_are_those_of_pandas(rows: list[tuple[int, int, int]]) -> None:
    frame = pd.DataFrame(rows, columns=["scene", "a", "b"], dtype=np.int64)
    found = repeats(*(frame[name].to_numpy() for name in frame))
    np.testing.assert_array_equal(found, frame.duplicated().to_numpy())


def test_a_file_that_says_other_rows_than_it_has_is_named(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    files = tuple(
        entry.model_copy(update={"rows": 1}) if entry.path == ROOMS else entry
        for entry in manifest.files
    )
    commit_manifest(dataset, manifest.model_copy(update={"files": files}))
    assert [fault.where for fault in check_dataset(dataset)] == [ROOMS]
