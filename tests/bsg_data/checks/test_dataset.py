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
from painted_meshes import write_painted
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.files import hold
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic

Change = Callable[[pd.DataFrame], pd.DataFrame]
OBJECTS, ROOMS = "objects/part-00000.parquet", "rooms/part-00000.parquet"
SCENES, EDGES = "scenes/part-00000.parquet", "edges/part-00000.parquet"
PAIRS, SPLITS = "pairs/", "splits/"  # found by what their names begin with


def edit(dataset: Path, file: str, change: Change) -> None:
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


def find_faults(dataset: Path) -> list[str]:
    return [f"{fault.where}: {fault.what}" for fault in check_dataset(dataset)]


def setting(column: str, value: object, row: int = 0) -> Change:
    def change(frame: pd.DataFrame) -> pd.DataFrame:
        values = list(frame[column])
        values[row] = value
        return frame.assign(**{column: pd.Series(values, dtype=frame[column].dtype)})

    return change


@pytest.mark.parametrize(
    ("file", "change", "expected"),
    [
        (SCENES, setting("num_rooms", 99), "num_rooms is not their number"),
        (SCENES, setting("scene_id", "00001-abcdefghi01"), "is there twice"),
        (SCENES, setting("building", "abcdefghi01"), "has two scene ids"),
        (SCENES, setting("scene_id", "../secret"), "cannot be part of a file name"),
        (SCENES, lambda f: f.iloc[::-1], "is not sorted by scene_id"),
        (SCENES, setting("class_map", "other"), "its class map is none of the manifest"),
        (ROOMS, setting("room_index", 7), "room 7: room_index does not run"),
        (ROOMS, setting("scene_id", "nowhere"), "is of no scene"),
        (ROOMS, lambda f: f.iloc[::-1], "or not in their order"),
        (ROOMS, setting("region_id", -7), "region_id is below 0"),
        (OBJECTS, setting("room_index", 77), "room_index is not 0..R"),
        (OBJECTS, setting("instance_id", 2), "instance_id does not rise"),
        (OBJECTS, lambda f: f.iloc[1:], "object_index does not run"),
        (OBJECTS, setting("colour", "red"), "colour is not RRGGBB"),
        (EDGES, lambda f: f.iloc[[0, *range(len(f))]], "an edge to each room and to each object"),
        (SPLITS, setting("split", "training"), "training: is not its split by the recipe"),
        (SPLITS, lambda f: f.iloc[1:], "is its split by the recipe, but not there"),
        (SPLITS, lambda f: pd.concat([f, f.head(1)]), "or is there twice"),
        (PAIRS, setting("draw", 3), "expected draws 0..3, in order"),
        (PAIRS, setting("scene_id", "nowhere"), "found None"),
        (PAIRS, setting("split", "val", 3), "expected test as `split` of every row"),
    ],
)
def test_damage_is_found(dataset: Path, file: str, change: Change, expected: str) -> None:
    edit(dataset, file, change)
    found = find_faults(dataset)
    assert any(expected in line for line in found), found


def test_rows_of_a_scene_that_lie_apart_are_found(dataset: Path) -> None:
    """A scene that is whole in two places of a file is sound in each: only the gap tells."""
    first = Dataset.open(dataset).splits["train"][0]
    paths = (entry.path for entry in read_manifest(dataset).files_of("pairs"))
    edit(
        dataset,
        next(path for path in paths if "train" in path),
        lambda f: pd.concat([f, f[f["scene_id"] == first]]),
    )
    assert [line.partition(": ")[2] for line in find_faults(dataset)] == [
        f"{first}: has pairs in 2 places, expected 1"
    ]


def test_files_that_changed_vanished_or_appeared_are_named(dataset: Path) -> None:
    (dataset / OBJECTS).write_bytes((dataset / OBJECTS).read_bytes()[:-1] + b"X")
    (dataset / ROOMS).unlink()
    (dataset / "pairs" / "notes.txt").write_text("mine")
    (dataset / "README.md").unlink()
    found = {fault.where for fault in check_dataset(dataset)}
    assert found == {ROOMS, OBJECTS, "pairs/notes.txt", "README.md"}


def test_a_file_of_other_columns_or_rows_is_named(dataset: Path) -> None:
    table = pq.read_table(dataset / SCENES)
    pq.write_table(table.drop_columns(["class_map"]), dataset / SCENES)
    list_again(dataset, SCENES, rows=len(table))
    list_again(dataset, ROOMS, rows=1)
    assert [fault.where for fault in check_dataset(dataset)] == [SCENES, ROOMS]


def test_a_class_map_that_is_not_the_published_one_is_named(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    source = manifest.sources[0]
    other = source.class_map.model_copy(update={"sha256": "0" * 64})
    changed = (source.model_copy(update={"class_map": other}),)
    commit_manifest(dataset, manifest.model_copy(update={"sources": changed}))
    assert any("is not the published one" in line for line in find_faults(dataset))


@pytest.fixture(scope="module")
def _placed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("placed")
    write_painted(folder / "places", scenes=1, seed=2)
    build_dataset(HM3DFolder(folder / "places"), folder / "dataset")
    return folder / "dataset"


@pytest.fixture
def placed(_placed: Path, tmp_path: Path) -> Path:
    """A dataset with geometry; each test has its own copy."""
    return Path(shutil.copytree(_placed, tmp_path / "placed"))


def adjacent(column: str, value: object) -> Change:
    def change(frame: pd.DataFrame) -> pd.DataFrame:
        row = int(np.flatnonzero(frame["kind"] == "adjacent")[0])
        return setting(column, value, row)(frame)

    return change


def with_a_box(column: str, value: object) -> Change:
    def change(frame: pd.DataFrame) -> pd.DataFrame:
        row = int(np.flatnonzero(frame["box_min_x"].notna())[0])
        return setting(column, value, row)(frame)

    return change


@pytest.mark.parametrize(
    ("file", "change", "expected"),
    [
        (OBJECTS, with_a_box("box_min_x", 99.0), "its box or its largest part is impossible"),
        (OBJECTS, with_a_box("centroid_y", None), "its box or its largest part is impossible"),
        (OBJECTS, with_a_box("box_min_x", None), "its box or its largest part is impossible"),
        (OBJECTS, with_a_box("area", 0.0), "area is not above 0"),
        (ROOMS, with_a_box("floor_area", np.inf), "its geometry is impossible"),
        (ROOMS, with_a_box("box_max_z", -99.0), "its geometry is impossible"),
        (ROOMS, with_a_box("footprint", [1.0, 2.0, 3.0]), "its geometry is impossible"),
        (ROOMS, with_a_box("box_max_x", 900.0), "its geometry is impossible"),
        (SCENES, setting("up_axis", "w"), "up_axis is none of"),
        (SCENES, setting("up_axis", None), "has a mesh in the manifest but no up_axis, or reverse"),
        (EDGES, adjacent("method", "guess"), "unknown method or distance"),
        (EDGES, adjacent("distance_m", 1.0), "unknown method or distance"),
        (EDGES, adjacent("source_index", 0), "must join two rooms, lower index first, once"),
        (EDGES, adjacent("target_index", 999), "must join two rooms, lower index first, once"),
    ],
)
def test_damaged_geometry_is_found(placed: Path, file: str, change: Change, expected: str) -> None:
    edit(placed, file, change)
    found = find_faults(placed)
    assert any(expected in line for line in found), found


def test_sums_of_the_manifest_that_do_not_add_up_are_found(placed: Path) -> None:
    manifest = read_manifest(placed)
    ((scene, mesh),) = manifest.meshes.items()
    more = {"listed": mesh.listed + 1, "listed_area": mesh.listed_area + 5}
    meshes = {scene: mesh.model_copy(update=more)}
    totals = manifest.totals.model_copy(update={"rooms": 1})
    commit_manifest(placed, manifest.model_copy(update={"meshes": meshes, "totals": totals}))
    assert find_faults(placed) == [
        f"dataset.json: totals.rooms: expected {manifest.totals.rooms}, found 1",
        f"dataset.json: {scene}: the texels of its mesh do not add up",
        f"dataset.json: {scene}: the surface of its mesh does not add up",
    ]


@pytest.fixture(scope="module")
def _in_shards(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("in_shards")
    list(write_synthetic(folder / "buildings", scenes=10, seed=3))
    build_dataset(HM3DFolder(folder / "buildings"), folder / "dataset", scenes_per_shard=3)
    split_dataset(folder / "dataset", SplitRecipe())
    write_pairs(folder / "dataset", PairsRecipe(draws=2))
    return folder / "dataset"


@pytest.fixture
def in_shards(_in_shards: Path, tmp_path: Path) -> Path:
    """Ten buildings in four parts, split, with two draws; each test has its own copy."""
    return Path(shutil.copytree(_in_shards, tmp_path / "in_shards"))


@pytest.mark.parametrize(
    ("value", "expected"),
    [("first", "is there twice"), ("key", "has two scene ids"), ("0-A", "is not sorted by")],
)
def test_scenes_of_another_part_are_known(in_shards: Path, value: str, expected: str) -> None:
    data = Dataset.open(in_shards)
    column = "building" if value == "key" else "scene_id"
    name = {"first": data.scene_ids[0], "key": data.keys[0]}.get(value, value)
    edit(in_shards, "scenes/part-00003.parquet", setting(column, name))
    found = find_faults(in_shards)
    assert any(expected in line for line in found), found


def test_objects_of_all_parts_are_counted_together(in_shards: Path) -> None:
    for entry in read_manifest(in_shards).files_of("objects"):
        edit(in_shards, entry.path, lambda frame: frame.assign(colour="red"))
    objects = sum(entry.rows for entry in read_manifest(in_shards).files_of("objects"))
    *named, more = check_dataset(in_shards)
    assert [fault.what.partition(": ")[2] for fault in named] == ["colour is not RRGGBB"] * 3
    assert more.what == f"… and {objects - 3} more: colour is not RRGGBB"


def test_a_table_with_a_part_too_few_is_named(in_shards: Path) -> None:
    manifest = read_manifest(in_shards)
    last = manifest.files_of("rooms")[-1]
    (in_shards / last.path).unlink()
    files = tuple(entry for entry in manifest.files if entry != last)
    commit_manifest(in_shards, manifest.model_copy(update={"files": files}))
    found = [fault.what for fault in check_dataset(in_shards)]
    assert any("4 of scenes, 3 of rooms, 4 of objects, 4 of edges" in what for what in found)


def test_a_dataset_that_another_command_writes_is_not_called_faulty(dataset: Path) -> None:
    """What the other has written is a stray file until it is named."""
    (dataset / "pairs" / "new-01234567.parquet").write_bytes(b"half")
    with hold(dataset), refuses(DatasetError, "folder-busy", dataset):
        check_dataset(dataset)
    assert len(check_dataset(dataset)) == 1


def test_a_dataset_that_was_replaced_during_a_check_is_checked_again(dataset: Path) -> None:
    parts: list[int] = []

    def replace_it(done: int, number: int) -> None:
        if not parts:
            write_pairs(dataset, PairsRecipe(draws=2), force=True)
        parts.append(done)

    assert check_dataset(dataset, progress=replace_it) == ()
    assert parts.count(1) == 2


def test_what_a_command_removes_after_its_commit_is_no_fault(dataset: Path) -> None:
    """The manifest is new when the check begins, and the old files go while it reads."""
    old = dataset / "pairs" / "old-01234567.parquet"
    old.write_bytes(b"replaced")
    assert check_dataset(dataset, progress=lambda *_: old.unlink(missing_ok=True)) == ()
