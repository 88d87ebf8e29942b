"""Every rule that tables keep is checked, though the manifest agrees with the damaged file.

That any flipped byte is found is shown in tests/faults/test_flips.py.
"""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from conftest import commit_manifest, describe_file
from mesh_files import write_homes
from refusals import refuses

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.errors import DatasetError
from bsg_data.files import hold
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe
from bsg_data.sources.hm3d import HM3DFolder

Change = Callable[[pd.DataFrame], pd.DataFrame]
FIRST, LAST = "part-00000.parquet", "part-00002.parquet"
TRAIN = "/train-00000.parquet"


def edit(dataset: Path, table: str, change: Change, *, end: str = ".parquet") -> None:
    """Change a table by hand and make the manifest agree, so that only the rows can tell."""
    manifest = read_manifest(dataset)
    name = next(entry.path for entry in manifest.files_of(table) if entry.path.endswith(end))
    stored = pq.read_table(dataset / name)
    frame = change(stored.to_pandas())
    edited = pa.Table.from_pandas(frame, schema=stored.schema, preserve_index=False)
    pq.write_table(edited, dataset / name)
    list_again(dataset, name, rows=len(frame))


def list_again(dataset: Path, name: str, *, rows: int) -> None:
    manifest, entry = read_manifest(dataset), describe_file(dataset, name, rows=rows)
    files = tuple(entry if other.path == name else other for other in manifest.files)
    commit_manifest(dataset, manifest.model_copy(update={"files": files}))


def setting(
    column: str, value: object, where: Callable[[pd.DataFrame], Any] | None = None
) -> Change:
    """Set a value in the first row, or in the first for which something holds."""

    def change(frame: pd.DataFrame) -> pd.DataFrame:
        values = list(frame[column])
        values[0 if where is None else int(np.flatnonzero(where(frame))[0])] = value
        return frame.assign(**{column: pd.Series(values, dtype=frame[column].dtype)})

    return change


def boxed(column: str, value: object) -> Change:
    return setting(column, value, lambda frame: frame["box_min_x"].notna())


def adjacent(column: str, value: object) -> Change:
    return setting(column, value, lambda frame: frame["kind"] == "adjacent")


@pytest.fixture(scope="module")
def placed_once(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("placed")
    write_homes(folder / "places", scenes=1)
    build_dataset(HM3DFolder(folder / "places"), folder / "dataset")
    return folder / "dataset"


def repeat_first(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.iloc[[0, *range(len(frame))]]


def turn(frame: pd.DataFrame) -> pd.DataFrame:
    return frame.iloc[::-1]


def repeat_scene(frame: pd.DataFrame) -> pd.DataFrame:
    """Each of the two places is sound: only the gap between them tells."""
    return pd.concat([frame, frame[frame["scene_id"] == frame["scene_id"].iloc[0]]])


@pytest.mark.parametrize(
    ("table", "change", "expected"),
    [
        ("scenes", setting("num_rooms", 99), "num_rooms is not their number"),
        ("scenes", setting("scene_id", "00001-abcdefghi01"), "is there twice"),
        ("scenes", setting("building", "abcdefghi01"), "has two scene ids"),
        ("scenes", setting("scene_id", "../secret"), "cannot be part of a file name"),
        ("scenes", turn, "is not sorted by scene_id"),
        ("scenes", setting("up_axis", "w"), "up_axis is none of"),
        ("rooms", setting("room_index", 7), "room 7: room_index does not run"),
        ("rooms", setting("scene_id", "nowhere"), "is of no scene"),
        ("rooms", turn, "or not in their order"),
        ("rooms", setting("region_id", -7), "region_id is below 0"),
        ("objects", setting("room_index", 77), "room_index is not 0..R"),
        ("objects", setting("instance_id", 2), "instance_id does not rise"),
        ("objects", lambda f: f.iloc[1:], "object_index does not run"),
        ("edges", repeat_first, "an edge to each room and to each object"),
        ("splits", setting("split", "training"), "training: is not its split by the recipe"),
        ("splits", lambda f: f.iloc[1:], "is its split by the recipe, but not there"),
        ("splits", repeat_first, "or is there twice"),
        ("pairs", setting("draw", 3), "expected draws 0..3, in order"),
        ("pairs", setting("scene_id", "nowhere"), "found None"),
        ("pairs", setting("split", "val"), "as `split` of every row"),
        ("pairs", repeat_scene, "has pairs in 2 places, expected 1"),
    ],
)
def test_a_broken_rule_is_found(dataset: Path, table: str, change: Change, expected: str) -> None:
    edit(dataset, table, change, end=TRAIN if table == "pairs" else ".parquet")
    found = [fault.what for fault in check_dataset(dataset)]
    assert any(expected in what for what in found), found


@pytest.mark.parametrize(
    ("table", "change", "expected"),
    [
        ("objects", boxed("box_min_x", 99.0), "its box or its largest part is impossible"),
        ("objects", boxed("centroid_y", None), "its box or its largest part is impossible"),
        ("objects", boxed("box_min_x", None), "its box or its largest part is impossible"),
        ("objects", boxed("area", 0.0), "area is not above 0"),
        ("rooms", boxed("floor_area", np.inf), "its geometry is impossible"),
        ("rooms", boxed("box_max_z", -99.0), "its geometry is impossible"),
        ("rooms", boxed("footprint", [1.0, 2.0, 3.0]), "its geometry is impossible"),
        ("rooms", boxed("box_max_x", 900.0), "its geometry is impossible"),
        ("edges", adjacent("method", "guess"), "unknown method or distance"),
        ("edges", adjacent("distance_m", 1.0), "unknown method or distance"),
        ("edges", adjacent("source_index", 0), "must join two rooms, lower index first, once"),
        ("edges", adjacent("target_index", 999), "must join two rooms, lower index first, once"),
    ],
)
def test_impossible_geometry_is_found(
    placed_once: Path, tmp_path: Path, table: str, change: Change, expected: str
) -> None:
    placed = Path(shutil.copytree(placed_once, tmp_path / "placed"))
    edit(placed, table, change)
    found = [fault.what for fault in check_dataset(placed)]
    assert any(expected in what for what in found), found


def test_files_that_vanished_appeared_or_hold_something_else_are_named(dataset: Path) -> None:
    (dataset / "rooms" / FIRST).unlink()
    (dataset / "pairs" / "notes.txt").write_text("mine")
    (dataset / "README.md").unlink()
    scenes = pq.read_table(dataset / "scenes" / LAST)
    pq.write_table(scenes.drop_columns(["class_map"]), dataset / "scenes" / LAST)
    list_again(dataset, f"scenes/{LAST}", rows=len(scenes))
    list_again(dataset, f"objects/{LAST}", rows=1)
    found = {fault.where for fault in check_dataset(dataset)}
    wrong = {f"rooms/{FIRST}", f"scenes/{LAST}", f"objects/{LAST}"}
    assert found == wrong | {"pairs/notes.txt", "README.md"}


def test_what_the_manifest_says_of_all_is_compared(dataset: Path) -> None:
    manifest = read_manifest(dataset)
    rooms = manifest.totals.rooms
    totals = manifest.totals.model_copy(update={"rooms": 1})
    commit_manifest(dataset, manifest.model_copy(update={"totals": totals}))
    (fault,) = check_dataset(dataset)
    assert fault.what == f"totals.rooms: expected {rooms}, found 1"
    (source,) = manifest.sources
    other = source.class_map.model_copy(update={"sha256": "0" * 64})
    sources = (source.model_copy(update={"class_map": other}),)
    files = tuple(one for one in manifest.files if one.path != f"rooms/{LAST}")
    commit_manifest(dataset, manifest.model_copy(update={"sources": sources, "files": files}))
    found = " ".join(fault.what for fault in check_dataset(dataset))
    assert "is not the published one" in found
    assert "3 of scenes, 2 of rooms, 3 of objects, 3 of edges" in found


def test_rows_of_all_parts_are_counted_together(dataset: Path) -> None:
    entries = read_manifest(dataset).files_of("objects")
    for entry in entries:
        edit(dataset, "objects", lambda frame: frame.assign(colour="red"), end=entry.path)
    *named, more = check_dataset(dataset)
    assert [fault.what.partition(": ")[2] for fault in named] == ["colour is not RRGGBB"] * 3
    others = sum(entry.rows for entry in entries) - 3
    assert more.what == f"… and {others} more: colour is not RRGGBB"


def test_a_dataset_that_another_command_writes_is_not_called_faulty(dataset: Path) -> None:
    """What the other has written is a stray file until it is named, and again after its commit."""
    stray = dataset / "pairs" / "new-01234567.parquet"
    stray.write_bytes(b"half")
    with hold(dataset), refuses(DatasetError, "folder-busy", dataset):
        check_dataset(dataset)
    assert len(check_dataset(dataset)) == 1
    assert check_dataset(dataset, progress=lambda *_: stray.unlink(missing_ok=True)) == ()
    parts: list[int] = []

    def replace_it(done: int, number: int) -> None:
        if not parts:
            write_pairs(dataset, PairsRecipe(draws=2), force=True)
        parts.append(done)

    assert check_dataset(dataset, progress=replace_it) == ()
    assert parts.count(1) == 2
