"""Pairs: the histogram that a mask leaves (input) and the true one (target), for each node."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import Executor
from itertools import chain
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from bsg_data.arrays import Bools, Counts
from bsg_data.dataset.commit import name_by_content, update_manifest
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import stack_histograms
from bsg_data.dataset.manifest import STAGED, FileEntry, Manifest
from bsg_data.dataset.schema import pairs_schema
from bsg_data.dataset.shards import write_parquet
from bsg_data.errors import DatasetError
from bsg_data.executors import run_all
from bsg_data.files import AnyPath
from bsg_data.observation.mask_streams import MaskStreams
from bsg_data.observation.masks import MASKS, Layout, sample_views
from bsg_data.observation.view import View, hide_cells
from bsg_data.recipes import MaskRecipe, PairsRecipe
from bsg_data.scene.connections import NO_CONNECTIONS, Connections

SCENES_PER_FILE = 64
SCENES_PER_GROUP = 8  # what several readers of one file divide among them
ROWS_PER_GROUP = 65_536
_MOST = np.iinfo(np.uint16).max


def sample_pairs(
    cells: Counts,
    recipe: PairsRecipe,
    *,
    scene_id: str,
    connections: Connections = NO_CONNECTIONS,
    draws: range | None = None,
    nameable: Bools | None = None,
) -> tuple[tuple[View, ...], Counts, Counts]:
    """Sample the masks of one building: D views, their inputs and their targets.

    Both are histograms `[K, C]` of the nodes that the views have, those of one after another.
    `cells` `[N, C]` are its classified objects, row 0 the null region; `draws` the numbers of the
    D draws, by default all of the recipe; `nameable` `[C]` as for `Layout`.
    """
    mask, numbers = recipe.mask, range(recipe.draws) if draws is None else draws
    differ = MASKS[mask.strategy].varies or mask.withhold or mask.detector
    looks = numbers if differ else numbers[:1]
    many, again = len(looks), len(numbers) // len(looks)
    layouts = [Layout(cells.shape, connections, nameable)] * many
    views = sample_views(layouts, _streams_of(mask, scene_id, looks))
    present = np.concatenate([view.cut(cells) for view in views])
    hidden = hide_cells(present, views, _streams_of(mask, scene_id, numbers))
    starts = np.cumsum([0, *(len(view.nodes) for view in views * again)])[:-1]
    targets = np.tile(stack_histograms(present, starts[:many]), (again, 1))
    hidden = stack_histograms(hidden, starts)
    return tuple(views * again), np.subtract(targets, hidden, out=hidden), targets


def _streams_of(mask: MaskRecipe, scene_id: str, draws: range) -> MaskStreams:
    return MaskStreams([mask] * len(draws), [scene_id] * len(draws), draws)


def write_pairs(
    dataset: AnyPath,
    recipe: PairsRecipe,
    *,
    force: bool = False,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Manifest:
    """Sample and write the pairs of every split, and return the new manifest.

    Args:
        dataset: a dataset with a split.
        recipe: the mask and the number of draws.
        force: replace existing pairs.
        executor: writes files in parallel; None writes them one by one in this process.
        progress: called with (files done, files in all).

    Raises:
        DatasetError: if the dataset has no split, has pairs and not `force`, cannot be written, or
            has a building with more than 65,535 objects of a class.
    """
    dataset = Path(dataset)

    def write(data: Dataset) -> Manifest:
        manifest = data.manifest
        if manifest.pairs is not None and not force:
            message = f"{dataset}: has pairs already; --force replaces them"
            raise DatasetError(message, code="pairs-exist", where=dataset)
        splits = data.require_splits()
        # Sort the files of all splits by their scenes: files of the same shards become neighbours.
        plan = sorted(
            (
                (f"{split}-{number:05d}.parquet", scenes[start : start + SCENES_PER_FILE])
                for split, scenes in splits.items()
                for number, start in enumerate(range(0, len(scenes), SCENES_PER_FILE))
            ),
            key=lambda file: file[1][0],
        )
        folder = dataset.absolute()  # a worker may run in another folder
        tasks = [(folder, data.sha256, name, scenes, recipe) for name, scenes in plan]
        written = list(run_all(_write_file, tasks, executor=executor, progress=progress))
        staged = {name: entry for (name, _), entry in zip(plan, written, strict=True)}
        files = name_by_content(
            dataset, f"pairs/{recipe.mask.strategy}", dict(sorted(staged.items()))
        )
        return manifest.with_table("pairs", files, pairs=recipe)

    return update_manifest(dataset, write, is_made=lambda manifest: manifest.pairs == recipe)


def stream_pairs(data: Dataset, split: str) -> Iterator[pa.Table]:
    """Yield the pairs of one split or fold, about `ROWS_PER_GROUP` rows at a time.

    A masked building is never divided.

    Raises:
        DatasetError: if there are none, naming the splits that have some.
    """
    files = data.manifest.files_of("pairs")
    entries = [file for file in files if split_of_file(file.path) == split]
    if not entries:
        held = sorted({split_of_file(file.path) for file in files})
        hint = f"it has some of {', '.join(held)}" if held else "run `bsg-data pairs` first"
        message = f"{data.path}: has no pairs of split {split!r}; {hint}"
        raise DatasetError(message, code="pairs-missing", where=split)
    return chain.from_iterable(_read_groups(data, entry) for entry in entries)


def _read_groups(data: Dataset, entry: FileEntry) -> Iterator[pa.Table]:
    """Yield the row groups of a file, some together; none of them divides a masked building."""
    with data.open_file(entry) as file:
        sizes = [file.metadata.row_group(k).num_rows for k in range(file.num_row_groups)]
        turns = (np.cumsum([0, *sizes])[:-1] // ROWS_PER_GROUP).tolist()
        for turn in dict.fromkeys(turns):
            groups = [k for k, other in enumerate(turns) if other == turn]
            yield file.read_row_groups(groups, use_threads=False)


def list_column(table: pa.Table, name: str) -> npt.NDArray[Any]:
    """Return a list column of the pairs as `[rows, C]`."""
    column = table[name].combine_chunks()
    values: npt.NDArray[Any] = column.flatten().to_numpy(zero_copy_only=False)
    return values.reshape(-1, column.type.list_size)


def read_views(table: pa.Table) -> View:
    """Return one view with all rows of a table of pairs."""
    shares = table["hidden_share"].to_numpy().astype(np.float64)
    nodes = table["node_index"].to_numpy().astype(np.int64)
    return View(table["visited"].to_numpy(), shares, list_column(table, "withheld"), nodes)


def split_of_file(path: str) -> str:
    """Return the split of a file of pairs: `pairs/uniform-3fa2c1d0/val-00000.parquet` → `val`."""
    return path.split("/")[-1].rpartition("-")[0]


def _write_file(
    dataset: Path, sha256: str, name: str, scenes: tuple[str, ...], recipe: PairsRecipe
) -> FileEntry:
    """Stage one file of pairs, and return its entry."""
    data = Dataset.open(dataset, sha256=sha256)
    space = data.manifest.class_space
    schema = pairs_schema(len(space.classes))
    batches = (
        _scene_batches(data, scene, split=split_of_file(name), recipe=recipe, schema=schema)
        for scene in scenes
    )
    return write_parquet(
        dataset,
        f"{STAGED}/{name}",
        _row_groups(batches),
        table="pairs",
        class_space=space,
        pairs=recipe.model_dump_json(),
    )


def _row_groups(scenes: Iterable[Iterable[pa.RecordBatch]]) -> Iterator[pa.Table]:
    """Yield tables of `SCENES_PER_GROUP` scenes, or of `ROWS_PER_GROUP` rows or somewhat more."""
    waiting: list[pa.RecordBatch] = []
    for number, batches in enumerate(scenes, 1):
        for batch in batches:
            waiting.append(batch)
            if sum(batch.num_rows for batch in waiting) >= ROWS_PER_GROUP:
                yield pa.Table.from_batches(waiting)
                waiting.clear()
        if waiting and number % SCENES_PER_GROUP == 0:
            yield pa.Table.from_batches(waiting)
            waiting.clear()
    if waiting:
        yield pa.Table.from_batches(waiting)


def _scene_batches(
    data: Dataset, scene: str, *, split: str, recipe: PairsRecipe, schema: pa.Schema
) -> Iterator[pa.RecordBatch]:
    """Yield the pairs of a scene, as many draws at a time as `ROWS_PER_GROUP` rows hold."""
    cells, connections = data.cells(scene), data.connections(scene)
    if (largest := int(cells.sum(axis=0).max(initial=0))) > _MOST:
        message = f"{scene}: expected at most {_MOST:,} objects of a class, found {largest:,}"
        raise DatasetError(f"{message}; build without it", code="building-too-large", where=scene)
    nodes = len(cells)
    at_once = max(1, ROWS_PER_GROUP // nodes)
    for first in range(0, recipe.draws, at_once):
        draws = range(first, min(first + at_once, recipe.draws))
        views, inputs, targets = sample_pairs(
            cells,
            recipe,
            scene_id=scene,
            connections=connections,
            draws=draws,
            nameable=data.nameable(scene),
        )
        sizes = [len(view.nodes) for view in views]
        columns = [
            pa.repeat(scene, len(inputs)),
            pa.repeat(split, len(inputs)),
            pa.array(np.repeat(np.array(draws, dtype=np.int32), sizes)),
            pa.array(np.concatenate([view.nodes for view in views]).astype(np.int32)),
            pa.array(np.concatenate([view.visited for view in views])),
            pa.array(np.concatenate([view.shares_float32 for view in views])),
            _lists(np.concatenate([view.withheld for view in views]), schema.field("withheld")),
            _lists(inputs.astype(np.uint16), schema.field("input")),
            _lists(targets.astype(np.uint16), schema.field("target")),
        ]
        yield pa.RecordBatch.from_arrays(columns, schema=schema)


def _lists(values: npt.NDArray[Any], field: pa.Field) -> pa.Array:
    """Return an array `[..., C]` as a list of C values a row."""
    return pa.FixedSizeListArray.from_arrays(pa.array(values.ravel()), type=field.type)
