"""Measure what opening a dataset and reading all of it takes beside pandas reading its columns."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pandas as pd
from timing import Speed, time_both

from bsg_data.build import build_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic

BUILDINGS, REPEATS = 145, 9  # as many as HM3D's of the train split that are public
BOX = [f"box_{end}_{axis}" for end in ("min", "max") for axis in "xyz"]
COLUMNS = {
    "scenes": ["scene_id", "num_rooms", "source", "building_kind"],
    "rooms": ["scene_id", "room_index", "label", "floor_area", "footprint", *BOX],
    "objects": ["scene_id", "room_index", "class_index", "category"],
    "edges": ["scene_id", "source_index", "target_index", "kind", "method", "distance_m"],
}


def measure(hm3d: Path | None) -> Iterator[Speed]:
    """Yield what a dataset takes to be opened and read, both ways."""
    with tempfile.TemporaryDirectory() as folder:
        raw, path = Path(folder, "raw"), Path(folder, "dataset")
        if hm3d is None:
            list(write_synthetic(raw, scenes=BUILDINGS, seed=0))
        build_dataset(HM3DFolder(hm3d or raw, meshes=False), path)
        assert read(path) == read_by_pandas(path)
        # An opened dataset is kept in memory by its place, so that each turn opens another copy.
        copies = [shutil.copytree(path, Path(folder, f"copy-{n}")) for n in range(REPEATS)]
        turn = count()
        ours, theirs = time_both(
            lambda: read(copies[next(turn)]), lambda: read_by_pandas(path), repeats=REPEATS
        )
        buildings = len(Dataset.open(path).scene_ids)
    yield Speed(
        what=f"opening a dataset of {buildings} buildings and reading all of it",
        against="pandas reading the same columns",
        ours_s=ours,
        theirs_s=theirs,
        target=0.6,
    )


def read(path: Path) -> int:
    """Open a dataset and ask for all that models read; return the number of classified objects."""
    data, objects = Dataset.open(path), 0
    for scenes in data.in_shards(data.scene_ids):
        for scene in scenes:
            objects += int(data.cells(scene).sum())
            data.connections(scene)
            data.surroundings(scene)
            data.unclassified(scene)
    return objects


def read_by_pandas(path: Path) -> int:
    """Read the same columns of the same files; return the number of classified objects."""
    frames = {
        table: [pd.read_parquet(file, columns=columns) for file in sorted((path / table).iterdir())]
        for table, columns in COLUMNS.items()
    }
    return sum(int(frame["class_index"].notna().sum()) for frame in frames["objects"])
