"""Check that every scene is in the split of the recipe, and has its pairs there."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator

import pyarrow as pa

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import FileEntry
from bsg_data.dataset.scenes import divide
from bsg_data.dataset.splits import assign_splits
from bsg_data.errors import RecipeError
from bsg_data.observation.pairs import split_of_file
from bsg_data.recipes import SplitRecipe

_Faults = Iterator[tuple[str, str]]  # name and rule


def check_splits(splits: pa.Table, scenes: pa.Table, recipe: SplitRecipe) -> _Faults:
    """Check that every scene is in the split of the recipe, once, and in no other."""
    own, sources = (_map_scenes(scenes, name) for name in ("source_split", "source"))
    try:
        expected = Counter(assign_splits(own, recipe, sources=sources).items())
    except RecipeError as error:
        yield "the split", f"cannot be made by the recipe: {error}"
        return
    rows = zip(splits["scene_id"].to_pylist(), splits["split"].to_pylist(), strict=True)
    found = Counter(rows)
    for scene, split in sorted(found - expected):
        yield f"{scene}, {split}", "is not its split by the recipe, or is there twice"
    for scene, split in sorted(expected - found):
        yield f"{scene}, {split}", "is its split by the recipe, but not there"


def check_pairs(
    data: Dataset, splits: pa.Table, read: Callable[[FileEntry], pa.Table | None]
) -> _Faults:
    """Check that every scene has its pairs in one file, which is of its split, all draws of them.

    Args:
        data: a dataset with sound tables and pairs.
        splits: its table of splits.
        read: reads a file; None if it has a fault.
    """
    draws = 1 if data.manifest.pairs is None else data.manifest.pairs.draws
    split_of, times = _map_scenes(splits, "split"), Counter[str]()
    for entry in data.manifest.files_of("pairs"):
        table = read(entry)
        for scene, rows in () if table is None else divide(table):
            where, split = f"{entry.path}, {scene}", split_of.get(scene)
            times[scene] += 1
            if split != split_of_file(entry.path):
                yield where, f"expected split {split_of_file(entry.path)}, found {split}"
            elif (said := rows["split"].unique().to_pylist()) != [split]:
                yield where, f"expected {split} as `split` of every row, found {said}"
            elif rows["draw"].unique().to_pylist() != list(range(draws)):
                yield where, f"expected draws 0..{draws - 1}, in order"
    for scene in sorted(split_of):
        if times[scene] != 1:
            yield scene, f"has pairs in {times[scene]} places, expected 1"


def _map_scenes(table: pa.Table, column: str) -> dict[str, str]:
    return dict(zip(table["scene_id"].to_pylist(), table[column].to_pylist(), strict=True))
