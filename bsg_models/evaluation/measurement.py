"""Measure models on the stored pairs of a split: every metric of DESIGN section 8, with intervals.

A metric is a ratio of sums over nodes, or a function of such sums. All of them take a weight per
building, so that a bootstrap over buildings, the unit that is drawn at random, costs one pass each.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt
import pandas as pd
from torch_geometric.loader import DataLoader

from bsg_models.belief.expectation import Expectation, join
from bsg_models.evaluation import metrics
from bsg_models.evaluation.metrics import Bools, Floats
from bsg_models.evaluation.presence import PresenceMeasurement
from bsg_models.inputs.graphs import MaskedGraphs
from bsg_models.zoo.model import BeliefModel

NODE_SETS = ("rooms", "building", "all")


@dataclass(frozen=True, eq=False)
class Truth:
    """What the stored pairs of a split say, over all N nodes of all draws.

    Attributes:
        inputs: `[N, C]` what the masks leave.
        targets: `[N, C]` what is there.
        is_building: `[N]`.
        visited: `[N]` whether the robot entered.
        building: `[N]` 0..B-1, the number of the node's building.
        draw: `[N]` number of the mask.
        scene_ids: `[B]`.
    """

    inputs: Floats
    targets: Floats
    is_building: Bools
    visited: Bools
    building: npt.NDArray[np.int64]
    draw: npt.NDArray[np.int64]
    scene_ids: tuple[str, ...]

    @property
    def hidden(self) -> Floats:
        """Hidden counts, `[N, C]`."""
        return self.targets - self.inputs


@dataclass(frozen=True, slots=True)
class Estimate:
    """A metric's value, its 95 % bootstrap interval over buildings, and its number of nodes."""

    value: float
    low: float
    high: float
    nodes: int


def read_truth(graphs: MaskedGraphs) -> Truth:
    """Return the truth of masked graphs, nodes in the order of the graphs."""
    scene_ids = tuple(dict.fromkeys(m.scene_id for m in graphs.masked))
    number = {scene: i for i, scene in enumerate(scene_ids)}
    sizes = [len(m.inputs) for m in graphs.masked]
    return Truth(
        inputs=np.concatenate([m.inputs for m in graphs.masked]).astype(float),
        targets=np.concatenate([m.targets for m in graphs.masked]).astype(float),
        is_building=np.concatenate([np.arange(size) == 0 for size in sizes]),
        visited=np.concatenate([m.visited for m in graphs.masked]),
        building=np.repeat([number[m.scene_id] for m in graphs.masked], sizes),
        draw=np.repeat([m.draw for m in graphs.masked], sizes),
        scene_ids=scene_ids,
    )


def predict_all(model: BeliefModel, graphs: MaskedGraphs, *, batch_size: int = 256) -> Expectation:
    """Return a model's expectation of every node of masked graphs, in their order."""
    return join([model.expect(batch) for batch in DataLoader(graphs, batch_size=batch_size)])


class Measurement:
    """All metrics of one model on one truth.

    What does not depend on the weights (distances, sorted scores) is computed once.
    """

    def __init__(self, truth: Truth, expectation: Expectation) -> None:
        self.truth = truth
        self.expectation = expectation
        self.scene_ids = truth.scene_ids

    def evaluate(self, building_weights: Floats | None = None) -> dict[str, float]:
        """Return every metric by name, e.g. `rooms/wasserstein_values/mean`.

        Args:
            building_weights: `[B]` how often each building counts; None counts each once.
        """
        weights = building_weights if building_weights is not None else np.ones(self._buildings)
        every = weights[self.truth.building]
        found: dict[str, float] = {}
        for name in NODE_SETS:
            keep = self._rows[name]
            for metric, value in self._of_nodes(keep, every[keep]):
                found[f"{name}/{metric}"] = value
            predicted, true = (sums.correlate(weights) for sums in self._sums[name])
            found[f"{name}/correlation_frobenius"] = float(np.linalg.norm(predicted - true))
        found.update(self._of_presence(every[self._rows["rooms"]]))
        return found

    @property
    def _buildings(self) -> int:
        return len(self.truth.scene_ids)

    @cached_property
    def _rows(self) -> Mapping[str, npt.NDArray[np.int64]]:
        building = self.truth.is_building
        sets = {"rooms": ~building, "building": building, "all": np.ones_like(building)}
        return {name: np.flatnonzero(mask) for name, mask in sets.items()}

    @cached_property
    def _sums(self) -> Mapping[str, tuple[_BuildingSums, ...]]:
        counts = (self.expectation.totals, self.truth.targets)
        return {
            name: tuple(
                _BuildingSums(c[rows], self.truth.building[rows], self._buildings) for c in counts
            )
            for name, rows in self._rows.items()
        }

    @cached_property
    def _distances(self) -> Mapping[str, Floats]:
        p = metrics.normalise(self.expectation.totals)
        q = metrics.normalise(self.truth.targets)
        return {
            "wasserstein_values": metrics.wasserstein_values(p, q),
            "energy_values": metrics.energy_values(p, q),
            "wasserstein_classes": metrics.wasserstein_classes(p, q),
            "energy_classes": metrics.energy_classes(p, q),
            "total_variation": metrics.total_variation(p, q),
        }

    @cached_property
    def _errors(self) -> Mapping[str, Floats]:
        """Per node, the mean over classes: `[N]`."""
        error = self.expectation.totals - self.truth.targets
        log_probability = self.expectation.log_probability(self.truth.hidden)
        return {
            "mean_error": error.mean(axis=1),
            "mean_absolute_error": np.abs(error).mean(axis=1),
            "hidden_nll": -log_probability.mean(axis=1),
        }

    def _of_nodes(
        self, rows: npt.NDArray[np.int64], weights: Floats
    ) -> Iterator[tuple[str, float]]:
        for name, values in self._distances.items():
            found = metrics.moments(values[rows], weights)
            yield from ((f"{name}/{part}", value) for part, value in found._asdict().items())
        for name, values in self._errors.items():
            yield name, metrics.moments(values[rows], weights).mean

    @cached_property
    def _presence(self) -> PresenceMeasurement:
        rooms = self._rows["rooms"]
        return PresenceMeasurement(
            presence=self.expectation.presence[rooms],
            seen=self.truth.inputs[rooms] > 0,
            hidden=self.truth.hidden[rooms] > 0,
            visited=self.truth.visited[rooms],
        )

    def _of_presence(self, weights: Floats) -> dict[str, float]:
        return {f"rooms/{name}": value for name, value in self._presence.evaluate(weights)}

    def count_nodes(self, metric: str) -> int:
        """Return the number of nodes that a metric is over."""
        name, _, rest = metric.partition("/")
        rows = self._rows[name]
        if rest.startswith(("top", "presence")):
            return self._presence.count_rooms(rest)
        distance = rest.rpartition("/")[0]
        if distance in self._distances:
            return int((~np.isnan(self._distances[distance][rows])).sum())
        return len(rows)


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
        return metrics.correlate_sums(weights @ self.number, weights @ self.sums, products)


class SplitsMeasurement:
    """One model's metrics over several splits: each measured on its own test set, then averaged.

    The scores of a model that was trained anew for each split cannot be pooled: a ranking or a
    correlation over two trainings is of neither. A building that is in several test sets has one
    weight in all.
    """

    def __init__(self, splits: Sequence[Measurement]) -> None:
        self.splits = tuple(splits)
        every = {scene for split in splits for scene in split.scene_ids}
        self.scene_ids = tuple(sorted(every))
        number = {scene: i for i, scene in enumerate(self.scene_ids)}
        self._places = [np.array([number[scene] for scene in s.scene_ids]) for s in splits]

    def evaluate(self, building_weights: Floats | None = None) -> dict[str, float]:
        """Return every metric as the mean over the splits in which it is defined."""
        weights = np.ones(len(self.scene_ids)) if building_weights is None else building_weights
        found = [
            split.evaluate(weights[places])
            for split, places in zip(self.splits, self._places, strict=True)
            if weights[places].any()
        ]
        return {name: metrics.mean_known([one[name] for one in found]) for name in found[0]}

    def count_nodes(self, metric: str) -> int:
        """Return the number of nodes of all splits that a metric is over."""
        return sum(split.count_nodes(metric) for split in self.splits)


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """A model's metrics, and the same of every resample of the buildings.

    Attributes:
        point: metric → value.
        resampled: metric → `[resamples]`.
        nodes: metric → number of nodes that it is over.
    """

    point: dict[str, float]
    resampled: dict[str, Floats]
    nodes: dict[str, int]

    def estimates(self) -> dict[str, Estimate]:
        """Return every metric with its interval."""
        return {name: self.estimate(name) for name in self.point}

    def estimate(self, name: str) -> Estimate:
        """Return one metric with its interval."""
        return self._estimate(name, self.point[name], self.resampled[name])

    def difference(self, other: Bootstrap, name: str) -> Estimate:
        """Return this model's metric minus another's, with the interval of the difference.

        It is paired: both met the same resamples, so that buildings which are hard for both do not
        widen it.
        """
        resampled = self.resampled[name] - other.resampled[name]
        return self._estimate(name, self.point[name] - other.point[name], resampled)

    def ratio(self, other: Bootstrap, name: str) -> Estimate:
        """Return this model's metric over another's, paired like `difference`."""
        resampled = self.resampled[name] / other.resampled[name]
        return self._estimate(name, self.point[name] / other.point[name], resampled)

    def _estimate(self, name: str, value: float, resampled: Floats) -> Estimate:
        low, high = value + interval(resampled)
        return Estimate(value, float(low), float(high), self.nodes[name])


def estimate(
    measurement: Measurement | SplitsMeasurement,
    *,
    resamples: int = 200,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> dict[str, Estimate]:
    """Return every metric with its bootstrap interval over buildings; see `bootstrap`."""
    found = bootstrap(measurement, resamples=resamples, seed=seed, progress=progress)
    return found.estimates()


def bootstrap(
    measurement: Measurement | SplitsMeasurement,
    *,
    resamples: int = 200,
    seed: int = 0,
    progress: Callable[[int, int], None] | None = None,
) -> Bootstrap:
    """Return every metric, and what it is on resamples of the buildings.

    The resamples depend on the seed and the number of buildings alone, so that all models on the
    same truth meet the same ones.

    Args:
        measurement: of one model.
        resamples: fewer than 2 give no intervals (nan).
        seed: of the resamples.
        progress: called with (resamples done, resamples in all).
    """
    point = measurement.evaluate()
    buildings = len(measurement.scene_ids)
    rng = np.random.Generator(np.random.PCG64(seed))
    drawn: list[dict[str, float]] = []
    for done in range(1, resamples + 1):
        weights = rng.multinomial(buildings, np.full(buildings, 1 / buildings)).astype(float)
        drawn.append(measurement.evaluate(weights))
        if progress is not None:
            progress(done, resamples)
    return Bootstrap(
        point=point,
        resampled={name: np.array([one[name] for one in drawn], dtype=float) for name in point},
        nodes={name: measurement.count_nodes(name) for name in point},
    )


def interval(resampled: Floats) -> Floats:
    """Return the 2.5 % and 97.5 % quantiles of resampled values around their mean, `[2]`.

    Around their mean, not as they are: a resample repeats buildings, which adds noise, and a norm
    such as Frobenius' only grows by it, so that its resamples lie above the value.
    """
    known = resampled[~np.isnan(resampled)]
    if len(known) < 2:
        return np.full(2, np.nan)
    return np.asarray(np.quantile(known, [0.025, 0.975]) - known.mean())


def count_empty(truth: Truth) -> dict[str, int]:
    """Count the nodes with an all-zero input or target: their distances are degenerate."""
    return {
        "empty_inputs": int((truth.inputs.sum(axis=1) == 0).sum()),
        "empty_targets": int((truth.targets.sum(axis=1) == 0).sum()),
    }


def measure_classes(
    truth: Truth, expectations: Mapping[str, Expectation], classes: Sequence[str]
) -> pd.DataFrame:
    """Return one row a model, node set and class: the paper's error in number, and presence.

    Columns: `model`, `nodes` (node set), `class`, `count` (mean true number), `mean_error`
    (O″ − O), `mean_absolute_error`, and for rooms `presence_auroc` and `presence_ap`.
    """
    sets = {"rooms": ~truth.is_building, "building": truth.is_building}
    rows = []
    for model, found in expectations.items():
        error = found.totals - truth.targets
        presence = found.presence
        for name, keep in sets.items():
            for c, class_name in enumerate(classes):
                ranking = metrics.rank(presence[keep, c], truth.hidden[keep, c] > 0)
                rows.append(
                    {
                        "model": model,
                        "nodes": name,
                        "class": class_name,
                        "count": truth.targets[keep, c].mean(),
                        "mean_error": error[keep, c].mean(),
                        "mean_absolute_error": np.abs(error[keep, c]).mean(),
                        "presence_auroc": metrics.auroc(ranking),
                        "presence_ap": metrics.average_precision(ranking),
                    }
                )
    return pd.DataFrame(rows)
