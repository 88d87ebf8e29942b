"""Read and write benchmark entries: predictions of any program as parquet files.

PREDICTIONS/MODEL.parquet           of a model trained on the train split
PREDICTIONS/MODEL/fold-K.parquet    of a model trained without fold K; the folder is one entry
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import resolve_links, stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.mask_hash import hash_masks, hash_splits
from bsg_models.errors import PredictionError
from bsg_models.evaluation.prediction_files import (
    Predictions,
    PredictionWriter,
    read_predictions,
)
from bsg_models.evaluation.predictions import AlignedPredictions, align
from bsg_models.inputs.folds import Split, scenes_of, splits_of
from bsg_models.studies.survey import stream_batches

Folds = tuple[int | None, ...]  # (None,) without folds


@dataclass(frozen=True, eq=False)
class Entry:
    """A file of predictions or a folder of them, aligned with the measured nodes."""

    name: str  # stem of the file, or name of the folder
    aligned: AlignedPredictions  # predictions of all measured nodes
    facts: dict[str, Any]  # where the entry comes from


def folds_of(data: Dataset, fold: int | None) -> Folds:
    """Return the folds to measure: one, all of a dataset in folds, or (None,) without folds."""
    number = sum(name.startswith("fold-") for name in data.splits)
    return tuple(range(number)) if fold is None and number else (fold,)


def hash_measured(data: Dataset, split: Split, folds: Folds) -> str:
    """Return the hash of the stored masks that are measured on."""
    names = {name for fold in folds for name in splits_of(data, split, fold=fold)}
    return hash_masks(data, sorted(names))


def read_entry(path: Path, data: Dataset, *, split: Split, folds: Folds) -> Entry:
    """Read an entry and align it with the nodes that are measured.

    If only one of several folds is measured, rows of other folds are skipped.
    """
    names = {scene for fold in folds for scene in scenes_of(data, split, fold=fold)}
    others = frozenset(s for name in data.splits.values() for s in name if s not in names)
    classes = data.manifest.class_space.classes
    nodes = sum(entry.rows for entry in data.manifest.files_of("pairs"))
    predictions = read_predictions(path, most_rows=nodes * len(classes))
    _require_masks(predictions, data, split=split, folds=folds)
    masked = (some for fold in folds for some in stream_batches(data, split, fold=fold))
    elsewhere = others if folds != (None,) else frozenset()
    facts = {
        "files": {file.name: hash_file(file) for file in predictions.files},
        "rows": len(predictions.rows),
        "exactly": predictions.exactly,
    }
    return Entry(
        path.stem if path.is_file() else resolve_links(path).name,
        align(predictions, masked, classes, elsewhere=elsewhere),
        facts,
    )


def open_entry(
    folder: Path, name: str, data: Dataset, *, split: Split, fold: int | None, force: bool = False
) -> PredictionWriter:
    """Open a writer of a run's expectations as an entry, which appears when it closes."""
    stem = stem_of(name)
    path = folder / f"{stem}.parquet" if fold is None else folder / stem / f"fold-{fold}.parquet"
    if path.exists() and not force:
        raise DatasetError(f"{path}: is there already; --force replaces it")
    masks = hash_measured(data, split, (fold,))
    return PredictionWriter(path, data.manifest.class_space.classes, masks_sha256=masks)


def _require_masks(predictions: Predictions, data: Dataset, *, split: Split, folds: Folds) -> None:
    ours = {hash_measured(data, split, folds), *hash_splits(data).values()}
    if other := sorted(predictions.masks - ours):
        raise PredictionError(
            f"{predictions.path}: was made for other masks ({other[0][:12]}…) than those of "
            f"{data.path}; `bsg-data info` lists the masks of a dataset"
        )
