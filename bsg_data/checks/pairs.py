"""Check that splits and pairs follow from the tables and their recipes: both are drawn again."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import PurePosixPath

import numpy as np
import pyarrow as pa

from bsg_data.arrays import find_runs
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import FileEntry
from bsg_data.dataset.splits import assign_splits
from bsg_data.errors import RecipeError
from bsg_data.observation.pairs import (
    fits_pairs,
    list_column,
    read_views,
    sample_pairs,
    split_of_file,
)
from bsg_data.recipes import PairsRecipe, SplitRecipe

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
    """Check the pairs file by file against the tables.

    Args:
        data: a dataset with sound tables and pairs.
        splits: its table of splits.
        read: reads a file; None if it has a fault.
    """
    entries, recipe = data.manifest.files_of("pairs"), data.manifest.pairs or PairsRecipe()
    split_of, times = _map_scenes(splits, "split"), Counter[str]()
    for entry in _sort_by_position(entries):
        table = read(entry)
        for scene, rows in () if table is None else _group(table):
            where, split = f"{entry.path}, {scene}", split_of.get(scene)
            times[scene] += 1
            if split != split_of_file(entry.path):
                yield where, f"expected split {split_of_file(entry.path)}, found {split}"
            elif (said := rows["split"].unique().to_pylist()) != [split]:
                yield where, f"expected {split} as `split` of every row, found {said}"
            else:
                yield from ((where, rule) for rule in _compare(data, scene, rows, recipe))
    for scene in sorted(split_of):
        expected = int(fits_pairs(data.cells(scene)))
        if times[scene] != expected:
            yield scene, f"has pairs in {times[scene]} places, expected {expected}"


def _map_scenes(table: pa.Table, column: str) -> dict[str, str]:
    return dict(zip(table["scene_id"].to_pylist(), table[column].to_pylist(), strict=True))


def _sort_by_position(entries: tuple[FileEntry, ...]) -> list[FileEntry]:
    """Return the files of pairs, sorted by their position in their split.

    Every split has its scenes in order, so files of the same shards become neighbours.
    """
    sizes = Counter(split_of_file(entry.path) for entry in entries)

    def position(entry: FileEntry) -> float:
        split = split_of_file(entry.path)  # `test-00003.parquet`: the fourth of its split
        return int(PurePosixPath(entry.path).stem.rpartition("-")[2]) / sizes[split]

    return sorted(entries, key=position)


def _group(table: pa.Table) -> Iterator[tuple[str, pa.Table]]:
    """Yield the rows of one scene after another; rows that lie apart are two groups."""
    names = table["scene_id"].combine_chunks()
    starts, _ = find_runs(names.dictionary_encode().indices.to_numpy())
    for start, end in pairwise([*starts.tolist(), len(table)]):
        yield names[start].as_py(), table.slice(start, end - start)


def _compare(data: Dataset, scene: str, rows: pa.Table, recipe: PairsRecipe) -> Iterator[str]:
    """Compare the pairs of a scene with those that the recipe draws."""
    views, inputs, targets = sample_pairs(
        data.cells(scene),
        recipe,
        scene_id=scene,
        connections=data.connections(scene),
        nameable=data.nameable(scene),
    )
    sizes = [len(view.nodes) for view in views]
    view, ends = read_views(rows), np.cumsum([0, *sizes]).tolist()
    if not np.array_equal(rows["draw"].to_numpy(), np.arange(recipe.draws).repeat(sizes)):
        yield f"expected {len(inputs)} rows of draws 0..{recipe.draws - 1}, in order"
    elif not np.array_equal(list_column(rows, "target"), targets):
        yield "target is not the histogram of the objects table"
    elif not (
        np.array_equal(list_column(rows, "input"), inputs)
        and all(
            drawn.agrees(view.take(*span))
            for drawn, span in zip(views, pairwise(ends), strict=True)
        )
    ):
        yield "is not the mask of its recipe, or another NumPy drew it"
