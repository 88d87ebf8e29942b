"""Count the stored pairs of a split in one pass, before anything is measured on them."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings
from bsg_models.evaluation.measurement import read_truth
from bsg_models.inputs.folds import Split
from bsg_models.inputs.graphs import stream_split

_MOST_SHOWN = 20_000  # nodes in figures: more cannot be told apart, and would fill memory


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


def stream_batches(
    data: Dataset, split: Split, *, fold: int | None, vocabulary: tuple[str, ...] = ()
) -> Iterator[MaskedBuildings]:
    """Yield the stored pairs of a split, at most `BATCH` masked buildings at a time."""
    for masked in stream_split(data, split, fold=fold, vocabulary=vocabulary):
        yield from masked.batches(BATCH)


def survey_split(data: Dataset, split: Split, *, fold: int | None) -> Survey:
    """Read the stored pairs of a split once, and count what is in them."""
    sizes: dict[str, float] = {}
    counts = dict.fromkeys(("rooms", "building", "empty_inputs", "empty_targets"), 0)
    number = 0
    for masked in stream_batches(data, split, fold=fold):
        truth = read_truth(masked)
        number += len(masked)
        counts["rooms"] += int((~truth.is_building).sum())
        counts["building"] += int(truth.is_building.sum())
        counts["empty_inputs"] += int((truth.inputs.sum(axis=1) == 0).sum())
        counts["empty_targets"] += int((truth.targets.sum(axis=1) == 0).sum())
        totals = masked.targets[masked.seen.starts[:-1]].sum(axis=1)
        sizes |= dict(zip(masked.seen.scene_ids, totals.astype(float).tolist(), strict=True))
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
