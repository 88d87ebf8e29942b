"""Measure (room, class) cells without holding them all: means over cells, and rankings."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from bsg_models.evaluation.metric_kinds import StreamedMetric
from bsg_models.evaluation.metrics import Bools, Floats
from bsg_models.evaluation.presence import SELECTIONS, select_cells
from bsg_models.evaluation.ranked_cells import RankedCells
from bsg_models.evaluation.streams import Batch, Gathered, Stream, Values


@dataclass(frozen=True, slots=True, kw_only=True)
class CellMetric(StreamedMetric):
    """A function of means over the cells of each selection.

    Attributes:
        addends: function of presence, whether an object is hidden, and which cells are selected,
            all `[N, C]`; returns what each room adds to K sums, `[N, K]`.
        combine: function of the K means over cells, `[W, K]`; returns the value, `[W]`.
    """

    addends: Callable[[Floats, Bools, Bools], Floats]
    combine: Callable[[Floats], Floats]

    @property
    def node_sets(self) -> tuple[str, ...]:
        """The rooms."""
        return ("rooms",)

    @property
    def parts(self) -> tuple[str, ...]:
        """The selections of cells."""
        return SELECTIONS

    def gather(self, stream: Stream) -> Gathered:
        """Start the sums."""
        return _CellSums(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class RankMetric(StreamedMetric):
    """A measure of the ranking of the cells of each selection.

    Attributes:
        measure: area under the ROC curve, or average precision.
        by_class: whether it is the mean over the classes in which it is defined.
    """

    measure: Literal["auroc", "precision"]
    by_class: bool = False

    @property
    def node_sets(self) -> tuple[str, ...]:
        """The rooms."""
        return ("rooms",)

    @property
    def parts(self) -> tuple[str, ...]:
        """The selections of cells."""
        return SELECTIONS

    def gather(self, stream: Stream) -> Gathered:
        """Start to read the ranking, which all metrics of this kind share."""
        return _Ranked(self, stream.share(RankedCells))


class _CellSums(Gathered):
    """Sums over the cells of each selection."""

    def __init__(self, metric: CellMetric) -> None:
        self._metric = metric
        self._rooms = dict.fromkeys(SELECTIONS, 0)
        self._sums: dict[str, Floats] = {}  # the first one is the number of cells

    def add(self, batch: Batch) -> None:
        truth, rows = batch.prediction.truth, batch.prediction.rows["rooms"]
        presence = batch.prediction.expectation.presence[rows]
        seen, hidden = truth.inputs[rows] > 0, truth.hidden[rows] > 0
        for name, keep in select_cells(seen, truth.visited[rows]).items():
            addends = self._metric.addends(presence, hidden, keep)
            sums = batch.sum(rows, np.column_stack([keep.sum(axis=1), addends]))
            self._sums[name] = self._sums[name] + sums if name in self._sums else sums
            self._rooms[name] += int(keep.any(axis=1).sum())

    def finish(self) -> Values:
        values = {}
        for name, sums in self._sums.items():
            number = sums[:, :1]
            means = np.divide(sums, number, out=np.full_like(sums, np.nan), where=number > 0)
            values["rooms", name] = self._metric.combine(means[:, 1:])
        return Values(values, {("rooms", name): rooms for name, rooms in self._rooms.items()})


class _Ranked(Gathered):
    """One measure of the shared ranking."""

    def __init__(self, metric: RankMetric, cells: RankedCells) -> None:
        self._metric, self._cells = metric, cells

    def add(self, batch: Batch) -> None:
        """Do nothing: the shared ranking collects the cells."""

    def finish(self) -> Values:
        ranks, measure = self._cells.ranks, self._metric.measure
        if self._metric.by_class:
            of_classes = (
                ranks.auroc_of_classes if measure == "auroc" else ranks.precision_of_classes
            )
            values = {name: _mean_known(one) for name, one in of_classes.items()}
        else:
            values = ranks.auroc if measure == "auroc" else ranks.precision
        return Values(
            {("rooms", name): one for name, one in values.items()},
            {("rooms", name): rooms for name, rooms in self._cells.rooms.items()},
        )


def _mean_known(values: Floats) -> Floats:
    """Return the means over classes of the values `[C, W]` that are not nan, `[W]`."""
    known = ~np.isnan(values)
    number = known.sum(axis=0)
    total = np.where(known, values, 0.0).sum(axis=0)
    means = np.divide(total, number, out=np.full(len(total), np.nan), where=number > 0)
    return np.asarray(means)
