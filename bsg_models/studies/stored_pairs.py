"""The stored pairs that models are measured on: what is in them, and predictions for them.

A dataset without a split is measured whole, under masks that are drawn for it.

PREDICTIONS/MODEL.parquet           of a model trained on the train split
PREDICTIONS/MODEL/fold-K.parquet    of a model trained without fold K; the folder is one entry
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import resolve_links, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.mask_hash import ALL, hash_splits
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings, stream_sampled
from bsg_data.recipes import PairsRecipe
from bsg_models.errors import PredictionError
from bsg_models.evaluation.measurement import read_truth
from bsg_models.evaluation.prediction_files import PredictionWriter, read_predictions
from bsg_models.evaluation.predictions import AlignedPredictions, align
from bsg_models.inputs.folds import Split, scenes_of, splits_of
from bsg_models.inputs.graphs import stream_split

Folds = tuple[int | None, ...]  # (None,) without folds
_MOST_SHOWN = 20_000  # nodes in figures: more cannot be told apart, and would fill memory


def folds_of(data: Dataset, fold: int | None) -> Folds:
    """Return the folds to measure: one, all of a dataset in folds, or (None,) without folds."""
    number = sum(name.startswith("fold-") for name in data.splits)
    return tuple(range(number)) if fold is None and number else (fold,)


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


@dataclass(frozen=True, eq=False)
class Survey:
    """The masked buildings of a split, or of one fold."""

    scene_ids: tuple[str, ...]  # `[B]` of the buildings, in their order
    sizes: Floats  # `[B]` number of classified objects of each
    masked: int  # number of masked buildings; every draw counts
    # `rooms`, `building`; `empty_inputs`, `empty_targets`: all-zero nodes, of degenerate distances
    counts: dict[str, int]

    @property
    def by_size(self) -> list[str]:
        """The buildings by size, the smallest first."""
        return [self.scene_ids[number] for number in np.argsort(self.sizes, kind="stable")]

    @property
    def example(self) -> str:
        """The building of median size, for the figures."""
        return self.by_size[len(self.scene_ids) // 2]

    @property
    def stride(self) -> int:
        """Number k such that every k-th masked building is shown."""
        return max(1, -(-(self.counts["rooms"] + self.counts["building"]) // _MOST_SHOWN))


def survey_split(
    data: Dataset, split: Split, *, fold: int | None, fresh: PairsRecipe | None = None
) -> Survey:
    """Read the masked buildings of `stream_batches` once, and count what is in them."""
    sizes: dict[str, float] = {}
    counts = dict.fromkeys(("rooms", "building", "empty_inputs", "empty_targets"), 0)
    number = 0
    for masked in stream_batches(data, split, fold=fold, fresh=fresh):
        truth = read_truth(masked)
        number += len(masked)
        counts["rooms"] += int((~truth.is_building).sum())
        counts["building"] += int(truth.is_building.sum())
        counts["empty_inputs"] += int((~truth.inputs.any(axis=1)).sum())
        counts["empty_targets"] += int((~truth.targets.any(axis=1)).sum())
        totals = truth.targets[masked.seen.starts[:-1]].sum(axis=1)
        sizes |= dict(zip(masked.seen.scene_ids, totals.tolist(), strict=True))
    if not sizes:  # buildings with too many objects have no pairs
        raise DatasetError(f"{data.path}: no building of the split {split!r} has pairs")
    return Survey(tuple(sizes), np.array(list(sizes.values())), number, counts)


def join_surveys(parts: Sequence[Survey]) -> Survey:
    """Return the surveys of several folds, of different buildings, as one."""
    return Survey(
        tuple(scene for part in parts for scene in part.scene_ids),
        np.concatenate([part.sizes for part in parts]),
        sum(part.masked for part in parts),
        {name: sum(part.counts[name] for part in parts) for name in parts[0].counts},
    )


@dataclass(frozen=True, eq=False)
class Entry:
    """A file of predictions or a folder of them, aligned with the measured nodes."""

    name: str  # stem of the file, or name of the folder
    aligned: AlignedPredictions  # predictions of all measured nodes
    facts: dict[str, Any]  # where the entry comes from


def read_entry(path: Path, data: Dataset, *, split: Split, folds: Folds) -> Entry:
    """Read an entry and align it with the nodes that are measured.

    If only one of several folds is measured, rows of other folds are skipped.
    """
    classes = data.manifest.class_space.classes
    nodes = sum(entry.rows for entry in data.manifest.files_of("pairs"))
    predictions = read_predictions(path, most_rows=nodes * len(classes))
    ours = {hash_measured(data, split, folds), *hash_splits(data).values()}
    if strange := sorted(predictions.masks - ours):
        raise PredictionError(
            f"{predictions.path}: was made for other masks ({strange[0][:12]}…) than those of "
            f"{data.path}; `bsg-data info` lists the masks of a dataset"
        )
    masked = (some for fold in folds for some in stream_batches(data, split, fold=fold))
    elsewhere: frozenset[str] = frozenset()
    if folds != (None,):
        measured = {scene for fold in folds for scene in scenes_of(data, split, fold=fold)}
        elsewhere = frozenset(s for some in data.splits.values() for s in some) - measured
    return Entry(
        path.stem if path.is_file() else resolve_links(path).name,
        align(predictions, masked, classes, elsewhere=elsewhere),
        facts={
            "files": {file.name: hash_file(file) for file in predictions.files},
            "rows": len(predictions.rows),
            "exactly": len(predictions.exactly),
        },
    )


def open_entry(
    folder: Path, name: str, data: Dataset, *, split: Split, fold: int | None
) -> PredictionWriter:
    """Open a writer of a run's expectations as an entry, which appears when it closes."""
    stem = stem_of(name)
    path = folder / f"{stem}.parquet" if fold is None else folder / stem / f"fold-{fold}.parquet"
    masks = hash_measured(data, split, (fold,))
    return PredictionWriter(path, data.manifest.class_space.classes, masks_sha256=masks)
