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
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal

import numpy as np
import numpy.typing as npt
from scipy import sparse

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.errors import RecipeError
from bsg_models.belief.expectation import Expectation, join
from bsg_models.evaluation.metrics import MOMENTS, correlate_sums, mean_known, moments_of_sums
from bsg_models.evaluation.presence import SELECTIONS, PresenceHistograms, select_cells
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


class Accumulator(ABC):
    """The sums of a metric over the batches so far."""

    @abstractmethod
    def add(self, batch: Batch) -> None:
        """Add some nodes; those of a building may come in several batches."""

    @abstractmethod
    def finish(self) -> Values:
        """Return the metric over all batches."""


class Stream:
    """The batches of one model on one split.

    Args:
        scene_ids: `[B]` of all buildings that will come.
        weights: `[B, W]` how often each building counts.
    """

    def __init__(self, scene_ids: Sequence[str], weights: Weights) -> None:
        self.weights = weights
        self.width = int(weights.shape[1])
        self._number = {scene: number for number, scene in enumerate(scene_ids)}
        self._cells: PresenceHistograms | None = None

    def rank_cells(self) -> PresenceHistograms:
        """Return the histograms of presence, which all metrics of ranks share."""
        self._cells = self._cells or PresenceHistograms(self.weights)
        return self._cells

    def batch(self, prediction: Prediction) -> Batch:
        """Return some nodes for the metrics, after counting their cells."""
        truth = prediction.truth
        numbers = np.array([self._number[scene] for scene in truth.scene_ids], dtype=np.int64)
        building = numbers[truth.building]
        if self._cells is not None:
            rooms = prediction.rows["rooms"]
            self._cells.add(truth, prediction.expectation, rooms, building[rooms])
        return Batch(prediction, building, self.weights)


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

    @abstractmethod
    def start(self, stream: Stream) -> Accumulator:
        """Start to measure a prediction in batches."""


class WholeMetric(Metric):
    """A metric that needs the whole prediction, which is kept in memory."""

    @abstractmethod
    def measure(self, prediction: Prediction, weights: Floats) -> Mapping[Key, float]:
        """Return (node set, part) → value, nan if it is not defined.

        Args:
            prediction: of N nodes.
            weights: `[N]` how often the building of each node counts.
        """

    def start(self, stream: Stream) -> Accumulator:
        """Start to keep the batches."""
        return _Whole(self, stream.weights)


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

    def start(self, stream: Stream) -> Accumulator:
        """Start to sum the powers of the values."""
        return _NodePowers(self, stream.width)

    def evaluate_nodes(self, prediction: Prediction) -> Floats:
        """Return the value of every node."""
        values = np.asarray(self.values(prediction.truth, prediction.expectation), dtype=float)
        nodes = len(prediction.truth.building)
        if values.shape != (nodes,):
            raise RecipeError(
                f"metric {self.label!r}: expected a value for each of {nodes} nodes, found "
                f"{list(values.shape)}"
            )
        return values


class _PresenceMetric(Metric):
    """A metric of the cells of each selection, over rooms."""

    @property
    def node_sets(self) -> tuple[str, ...]:
        return ("rooms",)

    @property
    def parts(self) -> tuple[str, ...]:
        return SELECTIONS


@dataclass(frozen=True, slots=True, kw_only=True)
class CellMetric(_PresenceMetric):
    """A function of means over the cells of each selection."""

    # function of presence, whether an object is hidden, and which cells are selected, all `[N, C]`;
    # returns what each room adds to K sums, `[N, K]`
    addends: Callable[[Floats, Bools, Bools], Floats]
    # function of the K means over cells, `[W, K]`; returns the value, `[W]`
    combine: Callable[[Floats], Floats]

    def start(self, stream: Stream) -> Accumulator:
        """Start the sums."""
        return _CellSums(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class RankMetric(_PresenceMetric):
    """A measure of the ranking of the cells of each selection."""

    measure: Literal["auroc", "precision"]  # area under the ROC curve, or average precision
    by_class: bool = False  # whether it is the mean over the classes in which it is defined

    def start(self, stream: Stream) -> Accumulator:
        """Start to count the cells, once for all metrics of this kind."""
        return _Ranked(self, stream.rank_cells())


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelationMetric(Metric):
    """A distance between predicted and true correlations of the classes over nodes."""

    # function of the two matrices `[C, C]`, predicted and true
    distance: Callable[[Floats, Floats], float]

    def start(self, stream: Stream) -> Accumulator:
        """Start to sum counts and their products."""
        return _Products(self, stream.width)


class _Whole(Accumulator):
    def __init__(self, metric: WholeMetric, weights: Weights) -> None:
        self._metric, self._weights = metric, weights
        self._batches: list[Batch] = []

    def add(self, batch: Batch) -> None:
        self._batches.append(batch)

    def finish(self) -> Values:
        parts = [batch.prediction for batch in self._batches]
        truth = join_truths([part.truth for part in parts])
        whole = Prediction(truth, join([part.expectation for part in parts]))
        numbers = np.concatenate([batch.building for batch in self._batches])
        weights = self._weights[numbers].astype(float)
        found = [self._metric.measure(whole, column) for column in weights.T]
        values = {key: np.array([one[key] for one in found], dtype=float) for key in found[0]}
        return Values(values, {key: len(whole.rows[key[0]]) for key in values})


class _NodePowers(Accumulator):
    """Sums of the powers of the values, about a value of the first batch."""

    def __init__(self, metric: NodeMetric, width: int) -> None:
        self._metric = metric
        self._powers = np.arange(5 if metric.spread else 2)
        self._centre = dict.fromkeys(metric.over, float("nan"))
        self._nodes = dict.fromkeys(metric.over, 0)
        self._sums = {name: np.zeros((width, len(self._powers))) for name in metric.over}

    def add(self, batch: Batch) -> None:
        values = self._metric.evaluate_nodes(batch.prediction)
        for name in self._metric.over:
            rows = batch.prediction.rows[name]
            rows = rows[~np.isnan(values[rows])]
            if not len(rows):
                continue
            if np.isnan(self._centre[name]):  # powers about the mean lose the fewest digits
                self._centre[name] = float(values[rows].mean())
            shifted = values[rows] - self._centre[name]
            self._nodes[name] += len(rows)
            self._sums[name] += batch.sum(rows, shifted[:, None] ** self._powers)

    def finish(self) -> Values:
        found: dict[Key, Floats] = {}
        for name, sums in self._sums.items():
            four = moments_of_sums(sums, centre=self._centre[name])
            found |= {(name, part): v for part, v in zip(self._metric.parts, four, strict=False)}
        return Values(found, {key: self._nodes[key[0]] for key in found})


class _CellSums(Accumulator):
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


class _Ranked(Accumulator):
    def __init__(self, metric: RankMetric, histograms: PresenceHistograms) -> None:
        self._metric, self._histograms = metric, histograms

    def add(self, batch: Batch) -> None:
        """Do nothing: the stream counts the cells."""

    def finish(self) -> Values:
        by_class = self._metric.by_class
        name = self._metric.measure + ("_of_classes" if by_class else "")
        ranks: dict[str, Floats] = getattr(self._histograms.ranks, name)
        return Values(
            {("rooms", key): mean_known(one) if by_class else one for key, one in ranks.items()},
            {("rooms", key): rooms for key, rooms in self._histograms.rooms.items()},
        )


class _Products(Accumulator):
    """Sums of counts and of their products, predicted and true, over rooms and over buildings."""

    def __init__(self, metric: CorrelationMetric, width: int) -> None:
        self._metric, self._width = metric, width
        self._nodes = dict.fromkeys(NODE_SETS, 0)
        self._centre: tuple[Floats, Floats] | None = None  # a covariance does not depend on it
        self._sums: dict[tuple[str, int], Floats] = {}

    def add(self, batch: Batch) -> None:
        prediction = batch.prediction
        counts = (prediction.expectation.totals, prediction.truth.targets)
        if self._centre is None:
            self._centre = counts[0].mean(axis=0), counts[1].mean(axis=0)
        for name, rows in prediction.rows.items():
            self._nodes[name] += len(rows)
            if name == "all":  # is the sum of the other two
                continue
            for number, (some, centre) in enumerate(zip(counts, self._centre, strict=True)):
                sums = _sum_products(batch, rows, some[rows] - centre)
                key = (name, number)
                self._sums[key] = self._sums[key] + sums if key in self._sums else sums

    def finish(self) -> Values:
        values = {}
        for name in NODE_SETS:
            parts = NODE_SETS[:2] if name == "all" else (name,)
            both = [
                np.sum([self._sums[part, number] for part in parts], axis=0) for number in range(2)
            ]
            values[name, ""] = np.array(
                [
                    self._metric.distance(*(_correlate(one[w]) for one in both))
                    for w in range(self._width)
                ]
            )
        return Values(values, {(name, ""): nodes for name, nodes in self._nodes.items()})


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
