"""Entries of the benchmark: predictions of other programs beside ours, and ours as such files.

PREDICTIONS/MODEL.parquet           of a run that was trained on a split
PREDICTIONS/MODEL/fold-K.parquet    of a run that was trained without fold K; the folder is an entry
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import stem_of
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.observation.mask_hash import hash_masks, hash_splits
from bsg_models.errors import PredictionError
from bsg_models.evaluation.prediction_files import (
    PredictionFiles,
    PredictionWriter,
    open_predictions,
)
from bsg_models.evaluation.predictions import LaidPredictions, PairCells
from bsg_models.inputs.folds import Split, scenes_of, splits_of
from bsg_models.studies.measuring import NodePredictor
from bsg_models.studies.survey import stream_batches

Folds = tuple[int | None, ...]


@dataclass(frozen=True, eq=False)
class Entry:
    """A file of predictions, or a folder of them, laid beside what is measured.

    Attributes:
        name: stem of the file, or name of the folder.
        laid: what it says of all nodes that are measured.
        facts: where it is from.
    """

    name: str
    laid: LaidPredictions
    facts: dict[str, Any]

    def open_fold(self, fold: int | None) -> NodePredictor:
        """Return what it says of a fold; it is the same for all folds."""
        return NodePredictor(self.laid.expect)


def folds_of(data: Dataset, fold: int | None) -> Folds:
    """Return the folds to measure: one, all of a dataset in folds, or (None,) without folds."""
    number = sum(name.startswith("fold-") for name in data.splits)
    return tuple(range(number)) if fold is None and number else (fold,)


def hash_measured(data: Dataset, split: Split, folds: Folds) -> str:
    """Return the hash of the stored masks that are measured on."""
    names = {name for fold in folds for name in splits_of(data, split, fold=fold)}
    return hash_masks(data, sorted(names))


def read_entry(path: Path, data: Dataset, *, split: Split, folds: Folds) -> Entry:
    """Read what somebody predicts, and lay it beside what is measured.

    Rows of other folds are passed over where one fold of several is measured.

    Raises:
        PredictionError: if it cannot be read, is of other masks, or a row is wrong or missing.
    """
    names = {scene for fold in folds for scene in scenes_of(data, split, fold=fold)}
    others = frozenset(s for name in data.splits.values() for s in name if s not in names)
    files = open_predictions(path, most_rows=_count_cells(data))
    _require_masks(files, data, split=split, folds=folds)
    masked = (some for fold in folds for some in stream_batches(data, split, fold=fold))
    classes = data.manifest.class_space.classes
    laid = files.lay(
        PairCells(masked, classes), elsewhere=others if folds != (None,) else frozenset()
    )
    facts = {
        "files": {file.name: hash_file(file) for file, _ in files.files},
        "rows": len(files),
        "exactly": files.exactly,
    }
    return Entry(path.stem if path.is_file() else path.resolve().name, laid, facts)


def _count_cells(data: Dataset) -> int:
    """Return the number of nodes times classes of all pairs."""
    rows = sum(entry.rows for entry in data.manifest.files_of("pairs"))
    return rows * len(data.manifest.class_space.classes)


def open_entry(
    folder: Path, name: str, data: Dataset, *, split: Split, fold: int | None, force: bool = False
) -> PredictionWriter:
    """Begin to write what a run expects as an entry; it is there when the writer is closed.

    Raises:
        DatasetError: if it is there already and not `force`, or cannot be written.
    """
    stem = stem_of(name)
    path = folder / f"{stem}.parquet" if fold is None else folder / stem / f"fold-{fold}.parquet"
    if path.exists() and not force:
        raise DatasetError(f"{path}: is there already; --force replaces it")
    masks = hash_measured(data, split, (fold,))
    return PredictionWriter(path, data.manifest.class_space.classes, masks_sha256=masks)


def _require_masks(
    predictions: PredictionFiles, data: Dataset, *, split: Split, folds: Folds
) -> None:
    ours = {hash_measured(data, split, folds), *hash_splits(data).values()}
    if other := sorted(predictions.masks - ours):
        raise PredictionError(
            f"{predictions.path}: was made for other masks ({other[0][:12]}…); `bsg-data info` "
            f"lists those of {data.path}"
        )
