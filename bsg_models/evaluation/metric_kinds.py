"""Define what a metric is: a row of `METRICS`, of one of these kinds.

- `NodeMetric`: a value per node, averaged with weights, or with all four moments.
- `PresenceMetric`: a function of (room, class) cells with presence, outcome and weight.
- `CorrelationMetric`: a function of weighted sums over nodes.

`bsg_models.evaluation.cell_metrics` defines two more kinds, of cells.

A metric *gathers* a prediction batch by batch, under the weights of all resamples at once
(`Metric.gather`). A metric that can only be *prepared* from a whole prediction receives it whole,
up to `MOST_WHOLE` nodes.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

from bsg_data.errors import RecipeError
from bsg_models.belief.expectation import Expectation, join
from bsg_models.evaluation.metrics import (
    Floats,
    Moments,
    correlate_sums,
    mean_known,
    moments_of_sums,
)
from bsg_models.evaluation.presence import SELECTIONS, Cells
from bsg_models.evaluation.streams import Batch, Gathered, Key, Stream, Values, Weights
from bsg_models.evaluation.truth import NODE_SETS, Prediction, Truth, join_truths

MOST_WHOLE = 250_000  # nodes of a whole prediction in memory: some hundred megabytes


@dataclass(frozen=True, slots=True)
class Prepared:
    """A metric of one prediction, ready to be evaluated for many weights.

    Attributes:
        evaluate: takes how often each building counts, `[B]`; returns (node set, part) → value, nan
            if it is not defined.
        nodes: (node set, part) → number of nodes behind it.
    """

    evaluate: Callable[[Floats], dict[Key, float]]
    nodes: Mapping[Key, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric(ABC):
    """A row of `METRICS`.

    The names of its values are `NODE_SET/METRIC` or `NODE_SET/METRIC/PART`.

    Attributes:
        label: common name, short enough for a column head.
        less: whether less is better; None if neither is, as for a signed error.
        about: what it is, in a sentence for the docs.
    """

    label: str
    less: bool | None
    about: str

    @property
    @abstractmethod
    def node_sets(self) -> tuple[str, ...]:
        """Some of `NODE_SETS`."""

    @property
    def parts(self) -> tuple[str, ...]:
        """The last part of the name; ("",) for a metric with one number per node set."""
        return ("",)

    @abstractmethod
    def prepare(self, prediction: Prediction) -> Prepared:
        """Compute everything that does not depend on weights."""

    def gather(self, stream: Stream) -> Gathered:
        """Start to measure a prediction in batches; this default keeps all of it in memory."""
        return _Whole(self, stream.weights)


@dataclass(frozen=True, slots=True, kw_only=True)
class StreamedMetric(Metric):
    """A metric that is computed batch by batch, without the whole prediction in memory."""

    @abstractmethod
    def gather(self, stream: Stream) -> Gathered:
        """Start to measure a prediction in batches."""

    def prepare(self, prediction: Prediction) -> Prepared:
        """Measure a whole prediction as one batch, again for each set of weights."""

        def measure(weights: Floats) -> Values:
            stream = Stream(prediction.truth.scene_ids, weights[:, None])
            gathered = self.gather(stream)
            gathered.add(stream.batch(prediction))
            return gathered.finish()

        def evaluate(weights: Floats) -> dict[Key, float]:
            return {key: float(value[0]) for key, value in measure(weights).values.items()}

        return Prepared(evaluate, measure(np.ones(len(prediction.truth.scene_ids))).nodes)


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeMetric(StreamedMetric):
    """A value per node, averaged over nodes with the weights of their buildings.

    Attributes:
        values: function of the truth and the expectation to `[N]`; nan for a node without a value.
        over: node sets.
        spread: whether variance, skewness and kurtosis are given besides the mean.
    """

    values: Callable[[Truth, Expectation], Floats]
    over: tuple[str, ...] = NODE_SETS
    spread: bool = False

    @property
    def node_sets(self) -> tuple[str, ...]:
        """Node sets over which it is averaged."""
        return self.over

    @property
    def parts(self) -> tuple[str, ...]:
        """The four moments, or none."""
        return Moments._fields if self.spread else ("",)

    def gather(self, stream: Stream) -> Gathered:
        """Start to sum the powers of the values."""
        return _NodePowers(self, stream.width)

    def evaluate_nodes(self, prediction: Prediction) -> Floats:
        """Return the value of every node.

        Raises:
            RecipeError: if the function does not give one value per node.
        """
        values = np.asarray(self.values(prediction.truth, prediction.expectation), dtype=float)
        nodes = len(prediction.truth.building)
        if values.shape != (nodes,):
            raise RecipeError(
                f"metric {self.label!r}: expected a value for each of {nodes} nodes, found "
                f"{list(values.shape)}"
            )
        return values


@dataclass(frozen=True, slots=True, kw_only=True)
class PresenceMetric(Metric):
    """A measure of presence over the (room, class) cells of each selection.

    It receives all cells at once; `bsg_models.evaluation.cell_metrics` has kinds that do not.

    Attributes:
        measure: function of some cells and their weights `[M]`.
        by_class: whether it is the mean over the classes in which it is defined.
    """

    measure: Callable[[Cells, Floats], float]
    by_class: bool = False

    @property
    def node_sets(self) -> tuple[str, ...]:
        """The rooms."""
        return ("rooms",)

    @property
    def parts(self) -> tuple[str, ...]:
        """The selections of cells."""
        return SELECTIONS

    def prepare(self, prediction: Prediction) -> Prepared:
        """Sort the cells, once for all metrics of this kind."""
        cells = prediction.cells
        groups = {
            name: cells.by_class[name] if self.by_class else [cells.together[name]]
            for name in SELECTIONS
        }
        building = prediction.truth.building[prediction.rows["rooms"]]

        def evaluate(weights: Floats) -> dict[Key, float]:
            of_rooms = weights[building]
            return {
                ("rooms", name): mean_known(
                    [self.measure(one, one.weigh(of_rooms)) for one in group]
                )
                for name, group in groups.items()
            }

        return Prepared(evaluate, {("rooms", name): cells.rooms[name] for name in SELECTIONS})


@dataclass(frozen=True, slots=True, kw_only=True)
class CorrelationMetric(StreamedMetric):
    """A distance between predicted and true correlations of the classes over nodes.

    Attributes:
        distance: function of the two matrices `[C, C]`, predicted and true.
    """

    distance: Callable[[Floats, Floats], float]

    @property
    def node_sets(self) -> tuple[str, ...]:
        """All node sets."""
        return NODE_SETS

    def gather(self, stream: Stream) -> Gathered:
        """Start to sum counts and their products."""
        return _Products(self, stream.width)


class _Whole(Gathered):
    """A whole prediction, for a metric that needs it."""

    def __init__(self, metric: Metric, weights: Weights) -> None:
        self._metric, self._weights = metric, weights
        self._batches: list[Batch] = []
        self._nodes = 0

    def add(self, batch: Batch) -> None:
        self._nodes += len(batch.building)
        if self._nodes > MOST_WHOLE:
            raise RecipeError(
                f"metric {self._metric.label!r} needs the whole prediction in memory, at most "
                f"{MOST_WHOLE:,} nodes; found more. Give it `gather` (docs/extending.md), or "
                "measure fewer buildings"
            )
        self._batches.append(batch)

    def finish(self) -> Values:
        parts = [batch.prediction for batch in self._batches]
        truth = join_truths([part.truth for part in parts])
        whole = Prediction(truth, join([part.expectation for part in parts]))
        _, first = np.unique(truth.building, return_index=True)
        numbers = np.concatenate([batch.building for batch in self._batches])
        weights = self._weights[numbers[first]].astype(float)
        prepared = self._metric.prepare(whole)
        columns = [prepared.evaluate(column) for column in weights.T]
        return Values(
            {key: np.array([one[key] for one in columns], dtype=float) for key in columns[0]},
            prepared.nodes,
        )


class _NodePowers(Gathered):
    """Sums of the powers of the values of a `NodeMetric`, about a value of the first batch."""

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


class _Products(Gathered):
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
                sums = batch.sum_products(rows, some[rows] - centre)
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


def _correlate(sums: Floats) -> Floats:
    """Return the correlations `[C, C]` from the output of `Batch.sum_products` for one weight."""
    return correlate_sums(float(sums[0, 0]), sums[0, 1:], sums[1:, 1:])
