"""The stored pairs that models are measured on: what is in them, and predictions for them.

A dataset without a split is measured whole, under masks that are drawn for it.

PREDICTIONS/MODEL.parquet           of a model trained on the train split
PREDICTIONS/MODEL/fold-K.parquet    of a model trained without fold K; the folder is one entry
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import resolve_links, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.mask_hash import ALL, hash_splits
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings, stream_sampled
from bsg_data.recipes import PairsRecipe
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.measurement import read_truth
from bsg_models.evaluation.prediction_files import PredictionWriter, read_predictions
from bsg_models.evaluation.predictions import align
from bsg_models.inputs.folds import Split, scenes_of, splits_of
from bsg_models.inputs.graphs import stream_split

Folds = tuple[int | None, ...]  # (None,) without folds
Expect = Callable[[MaskedBuildings], Expectation]


def folds_of(data: Dataset) -> Folds:
    """Return all folds of a dataset, or (None,) without folds."""
    number = sum(name.startswith("fold-") for name in data.splits)
    return tuple(range(number)) or (None,)


def hash_measured(data: Dataset, split: Split, folds: Folds) -> str:
    """Return the hash of the stored masks that are measured on."""
    names = {name for fold in folds for name in splits_of(data, split, fold=fold)}
    return hash_splits(data, sorted(names))[ALL]


def stream_batches(
    data: Dataset,
    split: Split,
    *,
    fold: int | None,
    vocabulary: tuple[str, ...] = (),
    fresh: PairsRecipe | None = None,
) -> Iterator[MaskedBuildings]:
    """Yield the stored pairs of a split, at most `BATCH` masked buildings at a time.

    With `fresh`, yield masks of all buildings instead.
    """
    if fresh is not None:
        for draw in range(fresh.draws):
            yield from stream_sampled(
                data, data.scene_ids, mask=fresh.mask, draw=draw, vocabulary=vocabulary
            )
        return
    for masked in stream_split(data, split, fold=fold, vocabulary=vocabulary):
        yield from masked.batches(BATCH)


def survey_split(
    data: Dataset, split: Split, *, fold: int | None, fresh: PairsRecipe | None = None
) -> pd.DataFrame:
    """Read what `stream_batches` yields once; return one row per masked building.

    The columns are `scene_id`, `objects` (classified), `rooms`, and `empty_inputs` and
    `empty_targets`: all-zero nodes, of degenerate distances.
    """
    frames = []
    for masked in stream_batches(data, split, fold=fold, fresh=fresh):
        truth, starts = read_truth(masked), masked.seen.starts
        columns = {
            "scene_id": masked.seen.scene_ids,
            "objects": truth.targets[starts[:-1]].sum(axis=1),
            "rooms": np.diff(starts) - 1,
        }
        for name, counts in (("empty_inputs", truth.inputs), ("empty_targets", truth.targets)):
            columns[name] = np.add.reduceat((~counts.any(axis=1)).astype(int), starts[:-1])
        frames.append(pd.DataFrame(columns))
    if not frames:  # buildings with too many objects have no pairs
        raise DatasetError(f"{data.path}: no building of the split {split!r} has pairs")
    return pd.concat(frames, ignore_index=True)


def read_entry(
    path: Path, data: Dataset, *, split: Split, folds: Folds
) -> tuple[str, Expect, dict[str, Any]]:
    """Read a file of predictions, or a folder of them, for the nodes that are measured.

    If only one of several folds is measured, rows of other folds are skipped.

    Returns:
        Name of the entry, what it predicts of measured buildings, and where it comes from.
    """
    classes = data.manifest.class_space.classes
    nodes = sum(entry.rows for entry in data.manifest.files_of("pairs"))
    predictions = read_predictions(path, most_rows=nodes * len(classes))
    ours = {hash_measured(data, split, folds), *hash_splits(data).values()}
    if strange := sorted(predictions.masks - ours):
        raise PredictionError(
            f"{path}: was made for other masks ({strange[0][:12]}…) than those of {data.path}; "
            "`bsg-data info` lists the masks of a dataset"
        )
    masked = (some for fold in folds for some in stream_batches(data, split, fold=fold))
    elsewhere: set[str] = set()
    if folds != (None,):
        measured = {scene for fold in folds for scene in scenes_of(data, split, fold=fold)}
        elsewhere = {s for some in data.splits.values() for s in some} - measured
    facts = {
        "files": {file.name: hash_file(file) for file in predictions.files},
        "rows": len(predictions.rows),
        "exactly": len(predictions.exactly),
    }
    name = path.stem if path.is_file() else resolve_links(path).name
    return name, align(predictions, masked, classes, elsewhere=elsewhere).expect, facts


def open_entry(
    folder: Path, name: str, data: Dataset, *, split: Split, fold: int | None
) -> PredictionWriter:
    """Open a writer of a run's expectations as an entry, which appears when it closes."""
    stem = stem_of(name)
    path = folder / f"{stem}.parquet" if fold is None else folder / stem / f"fold-{fold}.parquet"
    masks = hash_measured(data, split, (fold,))
    return PredictionWriter(path, data.manifest.class_space.classes, masks_sha256=masks)
