"""Define what a metric is: a row of `METRICS`, of one of these kinds.

- `NodeMetric`: a value per node, averaged with weights, or with all four moments.
- `CellMetric`: a function of means over (room, class) cells.
- `RankMetric`: AUROC or average precision of the ranking of the cells.
- `CorrelationMetric`: a function of weighted sums over nodes.
- `WholeMetric`: any function of a whole prediction and of weights; it keeps the batches in memory.

The resamples of the buildings are known before the first batch. So a metric keeps sums under each
of W weights (the data, and every resample) instead of its nodes. A building takes two bytes per
resample.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass, field
from itertools import product
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy import sparse

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.belief.expectation import Expectation, join
from bsg_models.evaluation.metrics import MOMENTS, correlate_sums, mean_known, moments_of_sums
from bsg_models.evaluation.presence import (
    RANKED,
    SELECTIONS,
    UNDEFINED,
    PresenceHistograms,
    select_cells,
)
from bsg_models.evaluation.truth import NODE_SETS, Prediction, Truth, join_truths

Key = tuple[str, str]  # node set, part
Weights = npt.NDArray[Any]  # `[B, W]` of floats or of whole numbers


@dataclass(frozen=True, slots=True)
class Values:
    """A metric under each of W weights."""

    values: Mapping[Key, Floats]  # (node set, part) → `[W]`; nan if it is not defined
    nodes: Mapping[Key, int]  # (node set, part) → number of nodes behind it


@dataclass(frozen=True, eq=False)
class Batch:
    """Some nodes of a prediction, with the weights of all B buildings."""

    prediction: Prediction  # of N nodes
    building: Ints  # `[N]` 0..B-1, the number of each node's building
    weights: Weights  # `[B, W]` how often each building counts

    def sum(self, rows: Ints, values: Floats) -> Floats:
        """Return the sums of values `[M, K]` of M nodes under every weight, `[W, K]`."""
        there, place = np.unique(self.building[rows], return_inverse=True)
        one_of = sparse.csr_array(
            (np.ones(len(rows)), (place, np.arange(len(rows)))), shape=(len(there), len(rows))
        )
        return np.asarray(self.weights[there].T.astype(float) @ (one_of @ values))


@dataclass(eq=False)
class Sums:
    """What one metric keeps of the batches so far, under names of its own."""

    weights: Weights  # `[B, W]` how often each building counts
    cells: Mapping[str, PresenceHistograms]  # of all metrics of ranks, by node set
    totals: dict[Hashable, Floats] = field(default_factory=dict)
    nodes: Counter[Hashable] = field(default_factory=Counter)
    centres: dict[Hashable, Floats] = field(default_factory=dict)
    batches: list[Batch] = field(default_factory=list)  # of a metric that needs them whole

    def add(self, name: Hashable, sums: Floats) -> None:
        """Add the sums of a batch."""
        self.totals[name] = self.totals[name] + sums if name in self.totals else sums

    def shift(self, name: Hashable, values: Floats) -> Floats:
        """Return values minus their mean in the first batch.

        Moments and covariances do not depend on the origin; near the mean they lose the fewest
        digits.
        """
        if name not in self.centres:
            self.centres[name] = values.mean(axis=0)
        return values - self.centres[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric(ABC):
    """A row of `METRICS`; its values are named `NODE_SET/METRIC` or `NODE_SET/METRIC/PART`."""

    label: str  # common name, short enough for a column head
    less: bool | None  # whether less is better; None if neither is, as for a signed error
    about: str  # what it is, in a sentence for the docs

    @property
    def node_sets(self) -> tuple[str, ...]:
        """Some of `NODE_SETS`."""
        return NODE_SETS

    @property
    def parts(self) -> tuple[str, ...]:
        """The last part of the name; ("",) for a metric with one number per node set."""
        return ("",)

    @property
    def keys(self) -> tuple[Key, ...]:
        """Node set and part of every value."""
        return tuple(product(self.node_sets, self.parts))

    @abstractmethod
    def add(self, batch: Batch, sums: Sums) -> None:
        """Add some nodes; those of a building may come in several batches."""

    @abstractmethod
    def finish(self, sums: Sums) -> Values:
        """Return the metric over all batches."""


class WholeMetric(Metric):
    """A metric that needs the whole prediction, which is kept in memory."""

    @abstractmethod
    def measure(self, prediction: Prediction, weights: Floats) -> Mapping[Key, float]:
        """Return (node set, part) → value, nan if it is not defined.

        Args:
            prediction: of N nodes.
            weights: `[N]` how often the building of each node counts.
        """

    def add(self, batch: Batch, sums: Sums) -> None:
        """Keep a batch."""
        sums.batches.append(batch)

    def finish(self, sums: Sums) -> Values:
        """Measure the joined batches under every weight."""
        parts = [batch.prediction for batch in sums.batches]
        truth = join_truths([part.truth for part in parts])
        whole = Prediction(truth, join([part.expectation for part in parts]))
        numbers = np.concatenate([batch.building for batch in sums.batches])
        found = [self.measure(whole, column) for column in sums.weights[numbers].astype(float).T]
        values = {key: np.array([one[key] for one in found], dtype=float) for key in found[0]}
        return Values(values, {key: len(whole.rows[key[0]]) for key in values})


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeMetric(Metric):
    """A value per node, averaged over nodes with the weights of their buildings."""

    # function of the truth and the expectation to `[N]`; nan for a node without a value
    values: Callable[[Truth, Expectation], Floats]
    over: tuple[str, ...] = NODE_SETS  # node sets
    spread: bool = False  # whether variance, skewness and kurtosis are given besides the mean

    @property
    def node_sets(self) -> tuple[str, ...]:
        """Node sets over which it is averaged."""
        return self.over

    @property
    def parts(self) -> tuple[str, ...]:
        """The four moments, or none."""
        return MOMENTS if self.spread else ("",)

    def add(self, batch: Batch, sums: Sums) -> None:
        """Add the powers of the values, about the mean of the first batch."""
        one = batch.prediction
        values = np.asarray(self.values(one.truth, one.expectation), dtype=float)
        for name in self.over:
            rows = one.rows[name]
            rows = rows[~np.isnan(values[rows])]
            if len(rows):
                shifted = sums.shift(name, values[rows])
                sums.nodes[name] += len(rows)
                sums.add(name, batch.sum(rows, shifted[:, None] ** self._powers))

    def finish(self, sums: Sums) -> Values:
        """Return the moments, or the mean."""
        found: dict[Key, Floats] = {}
        none = np.zeros((sums.weights.shape[1], len(self._powers)))
        for name in self.over:
            centre = float(sums.centres.get(name, np.nan))
            moments = moments_of_sums(sums.totals.get(name, none), centre=centre)
            found |= {(name, part): v for part, v in zip(self.parts, moments, strict=True)}
        return Values(found, {key: sums.nodes[key[0]] for key in found})

    @property
    def _powers(self) -> Ints:
        return np.arange(5 if self.spread else 2)


class _PresenceMetric(Metric):
    """A metric of the cells of each selection, over rooms and over buildings."""

    @property
    def node_sets(self) -> tuple[str, ...]:
        return RANKED

    @property
    def parts(self) -> tuple[str, ...]:
        return SELECTIONS

    @property
    def keys(self) -> tuple[Key, ...]:
        return tuple(key for key in product(RANKED, SELECTIONS) if key != UNDEFINED)


@dataclass(frozen=True, slots=True, kw_only=True)
class CellMetric(_PresenceMetric):
    """A function of means over the cells of each selection."""

    # function of presence, whether an object is hidden, and which cells are selected, all `[N, C]`;
    # returns what each node adds to K sums, `[N, K]`
    addends: Callable[[Floats, Bools, Bools], Floats]
    # function of the K means over cells, `[W, K]`; returns the value, `[W]`
    combine: Callable[[Floats], Floats]

    def add(self, batch: Batch, sums: Sums) -> None:
        """Add the number of cells, and the addends."""
        truth = batch.prediction.truth
        for node_set in RANKED:
            rows = batch.prediction.rows[node_set]
            presence = batch.prediction.expectation.presence[rows]
            seen, hidden = truth.inputs[rows] > 0, truth.hidden[rows] > 0
            for part, keep in select_cells(seen, truth.visited[rows], truth.known[rows]).items():
                addends = self.addends(presence, hidden, keep)
                columns = np.column_stack([keep.sum(axis=1), addends])
                sums.add((node_set, part), batch.sum(rows, columns))
                sums.nodes[node_set, part] += int(keep.any(axis=1).sum())

    def finish(self, sums: Sums) -> Values:
        """Combine the means."""
        values = {}
        for node_set, part in self.keys:
            total = sums.totals[node_set, part]
            number = total[:, :1]
            means = np.divide(total, number, out=np.full_like(total, np.nan), where=number > 0)
            values[node_set, part] = self.combine(means[:, 1:])
        return Values(values, {key: sums.nodes[key] for key in values})


@dataclass(frozen=True, slots=True, kw_only=True)
class RankMetric(_PresenceMetric):
    """A measure of the ranking of the cells of each selection."""

    measure: Literal["auroc", "precision"]  # area under the ROC curve, or average precision
    by_class: bool = False  # whether it is the mean over the classes in which it is defined

    def add(self, batch: Batch, sums: Sums) -> None:
        """Do nothing: cells are counted once for all metrics of this kind."""

    def finish(self, sums: Sums) -> Values:
        """Return the ranking of the counted cells."""
        values, nodes = {}, {}
        for node_set, part in self.keys:
            cells = sums.cells[node_set]
            one: Floats = getattr(cells.ranks, self.measure)[part]
            values[node_set, part] = mean_known(one[1:]) if self.by_class else one[0]
            nodes[node_set, part] = cells.nodes[part]
        return Values(values, nodes)


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelationMetric(Metric):
    """A distance between predicted and true correlations of the classes over nodes."""

    # function of the two matrices `[C, C]`, predicted and true
    distance: Callable[[Floats, Floats], float]

    def add(self, batch: Batch, sums: Sums) -> None:
        """Add counts and their products, predicted and true, over rooms and over buildings."""
        expectation, truth = batch.prediction.expectation, batch.prediction.truth
        totals = np.where(truth.known, expectation.totals, 0.0)
        for side, counts in (("predicted", totals), ("true", truth.targets)):
            shifted = sums.shift(side, counts)
            for name in ("rooms", "building"):
                rows = batch.prediction.rows[name]
                sums.add((name, side), _sum_products(batch, rows, shifted[rows]))
        for name, rows in batch.prediction.rows.items():
            sums.nodes[name] += len(rows)

    def finish(self, sums: Sums) -> Values:
        """Return the distances; sums of all nodes are those of rooms and buildings."""
        values = {}
        for name in NODE_SETS:
            parts = ("rooms", "building") if name == "all" else (name,)
            predicted, true = (
                np.sum([sums.totals[part, side] for part in parts], axis=0)
                for side in ("predicted", "true")
            )
            distances = [
                self.distance(_correlate(one), _correlate(other))
                for one, other in zip(predicted, true, strict=True)
            ]
            values[name, ""] = np.array(distances)
        return Values(values, {key: sums.nodes[key[0]] for key in values})


def _sum_products(batch: Batch, rows: Ints, values: Floats) -> Floats:
    """Return Σ z zᵀ over some nodes under every weight, `[W, 1 + K, 1 + K]`; z = (1, values)."""
    if not len(rows):
        return np.zeros((batch.weights.shape[1], *2 * (1 + values.shape[1],)))
    augmented = np.column_stack([np.ones(len(rows)), values])
    there, place = np.unique(batch.building[rows], return_inverse=True)
    order = np.argsort(place, kind="stable")
    ends = np.searchsorted(place[order], np.arange(1, len(there)))
    products = [own.T @ own for own in np.split(augmented[order], ends)]
    weights = batch.weights[there].T.astype(float)
    return np.tensordot(weights, np.stack(products), axes=1)


def _correlate(sums: Floats) -> Floats:
    """Return the correlations `[C, C]` from the output of `_sum_products` for one weight."""
    return correlate_sums(float(sums[0, 0]), sums[0, 1:], sums[1:, 1:])
