"""Choose the buildings of a dataset for training, validation and test."""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from typing import TYPE_CHECKING, Literal

import numpy as np

from bsg_data.dataset.histograms import choose_vocabulary
from bsg_data.errors import DatasetError

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset

Split = Literal["train", "val", "test"]


def splits_of(data: Dataset, split: Split, *, fold: int | None = None) -> tuple[str, ...]:
    """Return the stored splits that train, val or test is taken from."""
    names = tuple(data.splits)
    if not names:
        raise DatasetError(f"{data.path}: is not split yet; run `bsg-data split` first")
    folds = len(names) if names[0].startswith("fold-") else 0
    if folds and fold is None:
        raise DatasetError(
            f"{data.path}: is split into {folds} folds; train on one by "
            "`bsg-train --set data.fold=0`, or split it by `bsg-data split --ratios`"
        )
    if fold is None:
        chosen: tuple[str, ...] = tuple(name for name in names if name == split)
    elif 0 <= fold < folds:
        test, val = f"fold-{fold}", f"fold-{(fold + 1) % folds}"
        others = tuple(name for name in names if name != test)
        chosen = {"test": (test,), "val": (val,), "train": others}[split]
    else:
        raise DatasetError(f"{data.path}: has {folds or 'no'} folds; there is no fold {fold}")
    if not chosen:
        raise DatasetError(f"{data.path}: its {split} split is empty; split it in another way")
    return chosen


def scenes_of(data: Dataset, split: Split, *, fold: int | None = None) -> tuple[str, ...]:
    """Return the scene ids of train, val or test.

    In a dataset of K folds, `fold` is the test split. Half of the buildings of the next fold, every
    second one in the order of the split, are for validation. All others are for training, which
    needs as many buildings as possible.

    Raises:
        DatasetError: if the dataset is not split that way, or the split is empty.
    """
    names = splits_of(data, split, fold=fold)
    scenes = tuple(scene for name in names for scene in data.splits[name])
    if fold is None or split == "test":
        return scenes
    (next_fold,) = splits_of(data, "val", fold=fold)
    held = set(data.splits[next_fold][::2])
    return tuple(scene for scene in scenes if (scene in held) == (split == "val"))


def vocabulary_of(data: Dataset, scenes: Sequence[str], *, min_scenes: int) -> tuple[str, ...]:
    """Return the categories outside the classes that occur in enough of some scenes."""
    unclassified = (data.unclassified(scene) for some in data.in_shards(scenes) for scene in some)
    return choose_vocabulary(unclassified, min_scenes=min_scenes)


@lru_cache(maxsize=4)
def untaught_of(data: Dataset, *, fold: int | None = None) -> tuple[str, ...]:
    """Return the classes of which no train building has an object."""
    every = data.in_shards(scenes_of(data, "train", fold=fold))
    totals = sum(data.cells(scene).sum(axis=0) for some in every for scene in some)
    classes = np.array(data.manifest.class_space.classes)
    return tuple(classes[totals == 0].tolist())
