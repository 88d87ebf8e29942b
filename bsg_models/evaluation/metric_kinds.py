"""What a metric is: a row of `METRICS`, of one of three kinds by what it is computed from.

- `NodeMetric`: a value of every node, averaged with weights, or with all four moments.
- `PresenceMetric`: a function of (room, class) cells with presence, outcome and weight.
- `CorrelationMetric`: a function of weighted sums over nodes.

A metric is *prepared* once for a prediction; a bootstrap then evaluates it for many weights of the
buildings. What does not depend on the weights (distances, sorted scores) belongs to preparing.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.errors import RecipeError
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.metrics import Floats, Moments, correlate_sums, mean_known, moments
from bsg_models.evaluation.presence import SELECTIONS, Cells
from bsg_models.evaluation.truth import NODE_SETS, Prediction, Truth

Key = tuple[str, str]  # node set, part


@dataclass(frozen=True, slots=True)
class Prepared:
    """A metric of one prediction, to be evaluated for many weights.

    Attributes:
        evaluate: from how often each building counts, `[B]`, to (node set, part) → value; nan where
            it is not defined.
        nodes: (node set, part) → number of nodes that it is over.
    """

    evaluate: Callable[[Floats], dict[Key, float]]
    nodes: Mapping[Key, int]


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric(ABC):
    """A row of `METRICS`.

    Its values are named `NODE_SET/METRIC` or `NODE_SET/METRIC/PART`.

    Attributes:
        label: in the field's words, short enough for the head of a column.
        less: whether less of it is better; None where neither is, as of a signed error.
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
        """What follows the name; ("",) for a metric that is one number a node set."""
        return ("",)

    @abstractmethod
    def prepare(self, prediction: Prediction) -> Prepared:
        """Compute what does not depend on weights."""


@dataclass(frozen=True, slots=True, kw_only=True)
class NodeMetric(Metric):
    """A value of every node, averaged over nodes with the weights of their buildings.

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
        """Those that it is averaged over."""
        return self.over

    @property
    def parts(self) -> tuple[str, ...]:
        """The four moments, or none."""
        return Moments._fields if self.spread else ("",)

    def prepare(self, prediction: Prediction) -> Prepared:
        """Compute the values of all nodes.

        Raises:
            RecipeError: if the function gives another number of values than there are nodes.
        """
        values = np.asarray(self.values(prediction.truth, prediction.expectation), dtype=float)
        building = prediction.truth.building
        if values.shape != building.shape:
            raise RecipeError(
                f"metric {self.label!r}: expected a value for each of {len(building)} nodes, found "
                f"{list(values.shape)}"
            )
        rows = {name: prediction.rows[name] for name in self.over}
        sets = {name: (values[own], building[own]) for name, own in rows.items()}

        def evaluate(weights: Floats) -> dict[Key, float]:
            result: dict[Key, float] = {}
            for name, (own, of_building) in sets.items():
                four = moments(own, weights[of_building])
                result |= {
                    (name, part): value for part, value in zip(self.parts, four, strict=False)
                }
            return result

        known = {name: int((~np.isnan(own)).sum()) for name, (own, _) in sets.items()}
        return Prepared(evaluate, {(name, p): known[name] for name in sets for p in self.parts})


@dataclass(frozen=True, slots=True, kw_only=True)
class PresenceMetric(Metric):
    """A measure of presence over the (room, class) cells of each selection.

    Attributes:
        measure: function of some cells and their weights `[M]`.
        by_class: whether it is the mean of the measures of the classes in which it is defined.
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
class CorrelationMetric(Metric):
    """A distance of the predicted from the true correlations of the classes over nodes.

    Attributes:
        distance: function of the two matrices `[C, C]`, predicted and true.
    """

    distance: Callable[[Floats, Floats], float]

    @property
    def node_sets(self) -> tuple[str, ...]:
        """All of them."""
        return NODE_SETS

    def prepare(self, prediction: Prediction) -> Prepared:
        """Sum up counts and their products in every building."""
        truth = prediction.truth
        counts = (prediction.expectation.totals, truth.targets)
        buildings = len(truth.scene_ids)
        sums = {
            name: [_BuildingSums(c[rows], truth.building[rows], buildings) for c in counts]
            for name, rows in prediction.rows.items()
        }

        def evaluate(weights: Floats) -> dict[Key, float]:
            result: dict[Key, float] = {}
            for name, both in sums.items():
                predicted, true = (one.correlate(weights) for one in both)
                result[name, ""] = self.distance(predicted, true)
            return result

        return Prepared(evaluate, {(name, ""): len(r) for name, r in prediction.rows.items()})


class _BuildingSums:
    """Sums of counts and of their products per building: all that correlations need."""

    def __init__(self, counts: Floats, building: npt.NDArray[np.int64], buildings: int) -> None:
        classes = counts.shape[1]
        shifted = counts - counts.mean(axis=0, keepdims=True)
        self.number = np.bincount(building, minlength=buildings).astype(float)
        self.sums = np.zeros((buildings, classes))
        self.products = np.zeros((buildings, classes, classes))
        for b in range(buildings):
            own = shifted[building == b]
            self.sums[b] = own.sum(axis=0)
            self.products[b] = own.T @ own

    def correlate(self, weights: Floats) -> Floats:
        """Return the correlations `[C, C]` with every building weighed, `[B]`."""
        products = np.tensordot(weights, self.products, axes=1)
        return correlate_sums(weights @ self.number, weights @ self.sums, products)
