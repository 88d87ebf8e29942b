"""Define what a metric is: a row of `METRICS`, of one of two kinds.

- `NodeMetric`: a value per node, averaged with weights, or with all four moments.
- `PooledMetric`: a function of what a `Tally` counts of all nodes together.

The resamples of the buildings are known before the first batch. So sums under each of W weights
(the data, and every resample) are kept instead of nodes. A building takes two bytes per resample.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Callable, Hashable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from bsg_data.arrays import Floats, Ints
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.metrics import MOMENTS, moments_of_sums
from bsg_models.evaluation.presence import (
    RANKED,
    SELECTIONS,
    UNDEFINED,
    PresenceHistograms,
    select_cells,
)
from bsg_models.evaluation.truth import NODE_SETS, Prediction, Truth

Key = tuple[str, str]  # node set, part; the part is "" for a metric with one number per node set
Weights = npt.NDArray[Any]  # `[B, W]` of floats or of whole numbers
CELLS: tuple[Key, ...] = tuple(key for key in product(RANKED, SELECTIONS) if key != UNDEFINED)
BINS = 15  # of presence, of equal width, for the calibration error


class Values(NamedTuple):
    """A metric under each of W weights."""

    values: Mapping[Key, Floats]  # (node set, part) → `[W]`; nan if it is not defined
    nodes: Mapping[Key, int]  # (node set, part) → number of nodes behind it


class Tally:
    """What is kept of the predictions of one model for the buildings of a fold.

    Args:
        weights: `[B, W]` how often each building counts.

    Attributes:
        sums: name → weighted sums over nodes, `[W, …]`.
        nodes: name → number of these nodes.
        cells: node set → presence of its cells.
    """

    def __init__(self, weights: Weights) -> None:
        self.sums: dict[Hashable, Floats] = {}
        self.nodes: Counter[Hashable] = Counter()
        self.cells = {name: PresenceHistograms(weights) for name in RANKED}
        self.width = weights.shape[1]
        self._weights = weights
        self._centres: dict[Hashable, Floats] = {}

    def count(self, prediction: Prediction, building: Ints) -> None:
        """Add the cells and the counts of some nodes, of the buildings `[N]` by number."""
        truth, expectation = prediction.truth, prediction.expectation
        for node_set, cells in self.cells.items():
            rows = prediction.rows[node_set]
            cells.add(truth, expectation, rows, building[rows])
            self._count_errors(node_set, prediction, building)
        totals = np.where(truth.known, expectation.totals, 0.0)
        for side, counts in (("predicted", totals), ("true", truth.targets)):
            shifted = self.shift(side, counts)
            for node_set in RANKED:
                rows = prediction.rows[node_set]
                self._add((node_set, side), self._sum_products(building[rows], shifted[rows]))
                self.nodes[node_set, side] += len(rows)

    def add(self, name: Hashable, building: Ints, values: Floats) -> None:
        """Add the values `[M, K]` of M nodes, of the buildings `[M]` by number."""
        there, place = np.unique(building, return_inverse=True)
        shape = (len(there), len(building))
        one_of = sparse.csr_array((np.ones(len(building)), (place, np.arange(shape[1]))), shape)
        weights = self._weights[there].T.astype(float)
        self._add(name, np.asarray(weights @ (one_of @ values)))

    def shift(self, name: Hashable, values: Floats) -> Floats:
        """Return values minus their mean in the first batch.

        Moments and covariances do not depend on the origin; near the mean they lose the fewest
        digits.
        """
        return values - self._centres.setdefault(name, values.mean(axis=0))

    def centre(self, name: Hashable) -> float:
        """Return the mean that `shift` subtracts from the values of a name; nan without any."""
        return float(self._centres.get(name, np.nan))

    def means(self, name: Hashable) -> Floats:
        """Return the sums of a name over the first of them, `[W, K - 1]`; nan where that is 0."""
        sums = self.sums[name]
        number = sums[:, :1]
        means = np.divide(sums, number, out=np.full_like(sums, np.nan), where=number > 0)
        return np.asarray(means[:, 1:])

    def products(self, node_set: str, side: str) -> Floats:
        """Return Σ z zᵀ over the nodes, `[W, 1 + C, 1 + C]`; z = (1, counts of the classes)."""
        parts = RANKED if node_set == "all" else (node_set,)
        return np.asarray(np.sum([self.sums[part, side] for part in parts], axis=0))

    def _add(self, name: Hashable, sums: Floats) -> None:
        self.sums[name] = self.sums[name] + sums if name in self.sums else sums

    def _count_errors(self, node_set: str, prediction: Prediction, building: Ints) -> None:
        """Add the number of cells of each selection, with their squared errors, and with gaps."""
        truth, rows = prediction.truth, prediction.rows[node_set]
        presence = prediction.expectation.presence[rows]
        seen, off = truth.inputs[rows] > 0, presence - (truth.hidden[rows] > 0)
        for part, keep in select_cells(seen, truth.visited[rows], truth.known[rows]).items():
            number, squared = keep.sum(axis=1), (keep * off**2).sum(axis=1, keepdims=True)
            gaps = _bin_gaps(presence, keep * off)
            self.add((node_set, part, "squared"), building[rows], np.c_[number, squared])
            self.add((node_set, part, "gaps"), building[rows], np.c_[number, gaps])

    def _sum_products(self, building: Ints, values: Floats) -> Floats:
        """Return Σ z zᵀ over some nodes under every weight."""
        if not len(building):
            return np.zeros((self.width, *2 * (1 + values.shape[1],)))
        augmented = np.column_stack([np.ones(len(values)), values])
        there, place = np.unique(building, return_inverse=True)
        order = np.argsort(place, kind="stable")
        ends = np.searchsorted(place[order], np.arange(1, len(there)))
        products = [own.T @ own for own in np.split(augmented[order], ends)]
        weights = self._weights[there].T.astype(float)
        return np.tensordot(weights, np.stack(products), axes=1)


def _bin_gaps(presence: Floats, gaps: Floats) -> Floats:
    """Return the sums of the gaps `[N, C]` of each node in bins of presence, `[N, BINS]`."""
    which = np.minimum((presence * BINS).astype(np.int64), BINS - 1)
    place = np.arange(len(which))[:, None] * BINS + which
    sums = np.bincount(place.ravel(), gaps.ravel(), len(which) * BINS)
    return np.asarray(sums.reshape(-1, BINS), dtype=float)


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric(ABC):
    """A row of `METRICS`; its values are named `NODE_SET/METRIC` or `NODE_SET/METRIC/PART`."""

    label: str  # common name, short enough for a column head
    less: bool | None  # whether less is better; None if neither is, as for a signed error
    about: str  # what it is, in a sentence for the docs

    @property
    @abstractmethod
    def keys(self) -> tuple[Key, ...]:
        """Node set and part of every value."""

    @property
    def node_sets(self) -> tuple[str, ...]:
        """Some of `NODE_SETS`."""
        return tuple(dict.fromkeys(node_set for node_set, _ in self.keys))

    @abstractmethod
    def finish(self, tally: Tally) -> Values:
        """Return the metric over all batches."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeMetric(Metric):
    """A value per node, averaged over nodes with the weights of their buildings."""

    # function of the truth and the expectation to `[N]`; nan for a node without a value
    values: Callable[[Truth, Expectation], Floats]
    over: tuple[str, ...] = NODE_SETS  # node sets
    spread: bool = False  # whether variance, skewness and kurtosis are given besides the mean

    @property
    def keys(self) -> tuple[Key, ...]:
        """Node set and part of every value."""
        return tuple(product(self.over, MOMENTS if self.spread else ("",)))

    def add(self, prediction: Prediction, building: Ints, tally: Tally) -> None:
        """Add the powers of the values, about their mean in the first batch."""
        values = np.asarray(self.values(prediction.truth, prediction.expectation), dtype=float)
        for node_set in self.over:
            rows = prediction.rows[node_set]
            rows = rows[~np.isnan(values[rows])]
            if len(rows):
                shifted = tally.shift((self, node_set), values[rows])
                tally.nodes[self, node_set] += len(rows)
                tally.add((self, node_set), building[rows], shifted[:, None] ** self._powers)

    def finish(self, tally: Tally) -> Values:
        """Return the moments, or the mean."""
        found: list[Floats] = []
        none = np.zeros((tally.width, len(self._powers)))
        for node_set in self.over:
            name = (self, node_set)
            found += moments_of_sums(tally.sums.get(name, none), centre=tally.centre(name))
        nodes = {key: tally.nodes[self, key[0]] for key in self.keys}
        return Values(dict(zip(self.keys, found, strict=True)), nodes)

    @property
    def _powers(self) -> Ints:
        return np.arange(5 if self.spread else 2)


@dataclass(frozen=True, slots=True, kw_only=True)
class PooledMetric(Metric):
    """A function of all cells of presence, or of all counts, of a node set."""

    # function of the tally, a node set and a part; returns the value under every weight, `[W]`
    measure: Callable[[Tally, str, str], Floats]
    keys: tuple[Key, ...] = CELLS  # node set and part of every value

    def finish(self, tally: Tally) -> Values:
        """Return the metric over all batches."""
        values = {key: self.measure(tally, *key) for key in self.keys}
        return Values(values, {key: self._count_nodes(tally, *key) for key in self.keys})

    def _count_nodes(self, tally: Tally, node_set: str, part: str) -> int:
        if part:
            return tally.cells[node_set].nodes[part]
        parts = RANKED if node_set == "all" else (node_set,)
        return sum(tally.nodes[one, "true"] for one in parts)
