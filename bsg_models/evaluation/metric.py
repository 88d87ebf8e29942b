"""Define what a metric is: a row of `METRICS`, whose values are named by node set and part.

A bootstrap weights buildings, by how often each is drawn. The weights are known before the first
batch, so sums under each of W weights (the data, and every resample) are kept instead of nodes.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from itertools import product
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats, Ints
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.metrics import moments_of_sums
from bsg_models.evaluation.truth import NODE_SETS, Prediction, Truth

Weights = npt.NDArray[Any]  # `[B, W]` how often each building counts
SELECTIONS = ("all", "unseen", "unvisited")  # of cells, see `presence`
RANKED = ("rooms", "building")  # node sets whose cells are ranked


class Value(NamedTuple):
    """A value of a metric."""

    weighted: Floats  # `[W]` under each weight; nan if it is not defined
    nodes: int  # number of nodes behind it


Values = Mapping[tuple[str, str, str], Value]  # metric, node set and part → value


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A row of `METRICS`; its values are named `NODE_SET/METRIC` or `NODE_SET/METRIC/PART`."""

    label: str  # common name, short enough for a column head
    less: bool | None  # whether less is better; None if neither is, as for a signed error
    about: str  # what it is, in a sentence for the docs
    over: tuple[str, ...] = NODE_SETS  # node sets
    parts: tuple[str, ...] = ("",)  # of each node set: "" for one number, moments, or selections

    @property
    def keys(self) -> tuple[tuple[str, str], ...]:
        """Node set and part of every value; a robot has always visited its building."""
        pairs = product(self.over, self.parts)
        return tuple(key for key in pairs if key != ("building", "unvisited"))


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeMetric(Metric):
    """A value per node, averaged over nodes; `parts` are `MOMENTS`, or the mean alone."""

    # function of the truth and the expectation to `[N]`; nan for a node without a value
    values: Callable[[Truth, Expectation], Floats]


class NodeMoments:
    """Means and moments of metrics of nodes, under weights `[B, W]` of the buildings."""

    def __init__(self, rows: Mapping[str, Metric], weights: Weights) -> None:
        self._rows = {name: row for name, row in rows.items() if isinstance(row, NodeMetric)}
        self._weights = weights
        self._nodes = {(name, key): 0 for name, row in self._rows.items() for key in row.over}
        self._sums = {key: np.zeros((weights.shape[1], 5)) for key in self._nodes}
        self._centres: dict[tuple[str, str], float] = {}  # mean in the first batch

    def add(self, prediction: Prediction, building: Ints) -> None:
        """Add the powers of the values of N nodes, of the buildings `[N]` by number."""
        for name, row in self._rows.items():
            values = np.asarray(row.values(prediction.truth, prediction.expectation), dtype=float)
            for node_set in row.over:
                rows = prediction.rows[node_set]
                rows = rows[~np.isnan(values[rows])]
                if len(rows):
                    self._add((name, node_set), values[rows], building[rows])

    def _add(self, key: tuple[str, str], values: Floats, building: Ints) -> None:
        centre = self._centres.setdefault(key, float(values.mean()))
        powers = (values - centre)[:, None] ** np.arange(5)
        self._nodes[key] += len(values)
        self._sums[key] += sum_weighted(self._weights, building, powers)

    def finish(self) -> Values:
        """Return all values."""
        found = {}
        for (name, node_set), sums in self._sums.items():
            centre, nodes = self._centres.get((name, node_set), 0.0), self._nodes[name, node_set]
            moments = moments_of_sums(sums, centre=centre)
            for part, moment in zip(self._rows[name].parts, moments, strict=False):
                found[name, node_set, part] = Value(moment, nodes)
        return found


def sum_weighted(weights: Weights, building: Ints, values: Floats) -> Floats:
    """Return Σ w x `[W, K]` over values `[M, K]` of M nodes, of the buildings `[M]` by number."""
    return np.asarray(weights[building].T.astype(float) @ values)
