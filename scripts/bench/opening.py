"""Measure what opening a dataset and reading all of it takes beside pandas reading the same tables.

    python scripts/bench/opening.py

Ours: open it as a new process does, and ask every scene for its cells, connections and
surroundings. Theirs: `pandas.read_parquet` of the same files, with the columns of these.
"""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from itertools import count
from pathlib import Path

import pandas as pd
from synthetic import build_synthetic
from timing import Speed, print_speeds, time_both

from bsg_data.dataset.dataset import Dataset

BUILDINGS, REPEATS = 145, 7
BOX = [f"box_{end}_{axis}" for end in ("min", "max") for axis in "xyz"]
COLUMNS = {
    "scenes": ["scene_id", "num_rooms", "source", "building_kind"],
    "rooms": ["scene_id", "room_index", "label", "floor_area", "footprint", *BOX],
    "objects": ["scene_id", "room_index", "class_index", "category"],
    "edges": ["scene_id", "source_index", "target_index", "kind", "method", "distance_m"],
}


def measure() -> Iterator[Speed]:
    """Yield what a dataset takes to be opened and read, both ways."""
    with tempfile.TemporaryDirectory() as folder:
        path = build_synthetic(Path(folder), scenes=BUILDINGS).path
        # An opened dataset is kept in memory by its place, so that each turn opens another copy.
        copies = [shutil.copytree(path, Path(folder, f"copy-{n}")) for n in range(REPEATS)]
        turn = count()
        ours, theirs = time_both(
            lambda: read(copies[next(turn)]), lambda: read_by_pandas(path), repeats=REPEATS
        )
    yield Speed(
        what=f"opening a dataset of {BUILDINGS} buildings and reading all of it",
        against="pandas reading the same columns",
        ours_s=ours,
        theirs_s=theirs,
        target=1,
    )


def read(path: Path) -> None:
    """Open a dataset, and ask for everything that models read."""
    data = Dataset.open(path)
    for scenes in data.in_parts(data.scene_ids):
        for scene in scenes:
            data.cells(scene)
            data.connections(scene)
            data.surroundings(scene)


def read_by_pandas(path: Path) -> None:
    """Read the same columns of the same files into frames."""
    for table, columns in COLUMNS.items():
        for file in sorted((path / table).glob("*.parquet")):
            pd.read_parquet(file, columns=columns)


if __name__ == "__main__":
    print_speeds(measure())
