"""Entries of the benchmark: predictions of other programs beside ours, and ours as such files.

PREDICTIONS/MODEL.parquet           of a run that was trained on a split
PREDICTIONS/MODEL/fold-K.parquet    of a run that was trained without fold K; the folder is an entry
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import hash_file, stem_of
from bsg_data.observation.mask_hash import hash_masks, hash_splits
from bsg_data.observation.masked_buildings import MaskedBuildings, stack_masked
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.prediction_files import read_predictions, write_predictions
from bsg_models.evaluation.predictions import Predictions
from bsg_models.inputs.folds import Split, splits_of
from bsg_models.inputs.graphs import read_split

Folds = tuple[int | None, ...]


@dataclass(frozen=True, eq=False)
class Entry:
    """A file of predictions, or a folder of them, laid beside what is measured.

    Attributes:
        name: stem of the file, or name of the folder.
        splits: what it expects of every fold that is measured.
        whole: the same of all folds together.
        facts: where it is from.
    """

    name: str
    splits: tuple[Expectation, ...]
    whole: Expectation
    facts: dict[str, Any]


def folds_of(data: Dataset, fold: int | None) -> Folds:
    """Return the folds to measure: one, all of a dataset in folds, or (None,) without folds."""
    number = sum(name.startswith("fold-") for name in data.splits)
    return tuple(range(number)) if fold is None and number else (fold,)


def hash_measured(data: Dataset, split: Split, folds: Folds) -> str:
    """Return the hash of the stored masks that are measured on."""
    names = {name for fold in folds for name in splits_of(data, split, fold=fold)}
    return hash_masks(data, sorted(names))


def read_entry(
    path: Path, data: Dataset, parts: Sequence[MaskedBuildings], *, split: Split, folds: Folds
) -> Entry:
    """Read what somebody predicts, and lay it beside what is measured.

    Rows of other folds are passed over where one fold of several is measured.

    Raises:
        PredictionError: if it cannot be read, is of other masks, or a row is wrong or missing.
    """
    classes = data.manifest.class_space.classes
    rows = sum(entry.rows for entry in data.manifest.files_of("pairs"))
    predictions = read_predictions(path, most_rows=rows * len(classes))
    _require_masks(predictions, data, split=split, folds=folds)
    whole = stack_masked(parts)
    here = set(whole.seen.scene_ids)
    others = frozenset(s for name in data.splits.values() for s in name if s not in here)
    elsewhere = others if folds != (None,) else frozenset()
    every = predictions.lay(whole, classes, elsewhere=elsewhere)
    splits = [every]
    if len(parts) > 1:
        ids = [set(part.seen.scene_ids) for part in parts]
        splits = [
            predictions.lay(part, classes, elsewhere=elsewhere | frozenset(here - own))
            for part, own in zip(parts, ids, strict=True)
        ]
    facts = {
        "files": {file.name: hash_file(file) for file, _ in predictions.files},
        "rows": len(predictions),
        "exactly": len(predictions.exactly),
    }
    return Entry(path.stem if path.is_file() else path.resolve().name, tuple(splits), every, facts)


def write_entry(
    folder: Path,
    name: str,
    expectation: Expectation,
    data: Dataset,
    *,
    split: Split,
    fold: int | None,
    force: bool = False,
) -> Path:
    """Write what a run expects as an entry, and return its file.

    Raises:
        DatasetError: if it is there already and not `force`, or cannot be written.
    """
    stem = stem_of(name)
    path = folder / f"{stem}.parquet" if fold is None else folder / stem / f"fold-{fold}.parquet"
    if path.exists() and not force:
        raise DatasetError(f"{path}: is there already; --force replaces it")
    write_predictions(
        path,
        expectation,
        read_split(data, split, fold=fold),
        data.manifest.class_space.classes,
        masks_sha256=hash_measured(data, split, (fold,)),
    )
    return path


def _require_masks(predictions: Predictions, data: Dataset, *, split: Split, folds: Folds) -> None:
    ours = {hash_measured(data, split, folds), *hash_splits(data).values()}
    if other := sorted(predictions.masks - ours):
        raise PredictionError(
            f"{predictions.path}: was made for other masks ({other[0][:12]}…); `bsg-data info` "
            f"lists those of {data.path}"
        )
