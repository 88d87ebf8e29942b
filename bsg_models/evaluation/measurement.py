"""Measure models on the stored pairs of a split: every metric, for any weights of the buildings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bsg_data.errors import RecipeError
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.expectation import Expectation, join
from bsg_models.evaluation import metrics
from bsg_models.evaluation.bootstrap import Bootstrap, weigh_buildings
from bsg_models.evaluation.catalogue import METRICS, list_values, name_value
from bsg_models.evaluation.metrics import Bools, Floats
from bsg_models.evaluation.streams import Key, Stream, Values, Weights
from bsg_models.evaluation.truth import Prediction, Truth
from bsg_models.zoo.model import BeliefModel

# Version of the metrics and of the reading of predictions: it rises if equal predictions would get
# another value. So results of one version can be compared.
EVALUATOR_VERSION = 1


def read_truth(masked: MaskedBuildings) -> Truth:
    """Return the truth of masked buildings, nodes in their order."""
    seen = masked.seen
    scene_ids = tuple(dict.fromkeys(seen.scene_ids))
    number = {scene: i for i, scene in enumerate(scene_ids)}
    sizes = np.diff(seen.starts)
    return Truth(
        inputs=seen.inputs.astype(float),
        targets=masked.targets.astype(float),
        is_building=seen.is_building,
        visited=seen.visited,
        building=np.repeat([number[scene] for scene in seen.scene_ids], sizes),
        draw=np.repeat(masked.draws, sizes),
        scene_ids=scene_ids,
    )


def predict_all(model: BeliefModel, masked: MaskedBuildings, *, batch: int = 256) -> Expectation:
    """Return a model's expectation of every node of masked buildings, in their order."""
    return join([model.expect(some.seen) for some in masked.batches(batch)])


@dataclass(frozen=True, eq=False)
class Measured:
    """Every metric of one model under W weights of the buildings."""

    # metric → `[W]`, in the order of all tables; the first column is the data
    values: Mapping[str, Floats]
    nodes: Mapping[str, int]  # metric → number of nodes behind it

    def bootstrap(self) -> Bootstrap:
        """Return the values with those of every resample, as `weigh_buildings` weighs them."""
        return Bootstrap(
            point={name: float(value[0]) for name, value in self.values.items()},
            resampled={name: value[1:] for name, value in self.values.items()},
            nodes=dict(self.nodes),
        )


class StreamedMeasurement:
    """All metrics of one model on one split, without keeping its nodes.

    Args:
        scene_ids: `[B]` of all buildings that will be added.
        weights: `[B, W]` how often each building counts, such as `weigh_buildings` returns.
    """

    def __init__(self, scene_ids: Sequence[str], weights: Weights) -> None:
        self._stream = Stream(scene_ids, weights)
        self._sums = {
            name: metric.start(self._stream) for name, metric in METRICS.load_all()[0].items()
        }

    def add(self, truth: Truth, expectation: Expectation) -> None:
        """Add some nodes, in any order."""
        batch = self._stream.batch(Prediction(truth, expectation))
        for accumulator in self._sums.values():
            accumulator.add(batch)

    def finish(self) -> Measured:
        """Return every metric by name, e.g. `rooms/wasserstein_values/mean`."""
        values: dict[str, Floats] = {}
        nodes: dict[str, int] = {}
        for row, accumulator in self._sums.items():
            found = accumulator.finish()
            _require_parts(row, found.nodes)
            values |= {name_value(row, *key): value for key, value in found.values.items()}
            nodes |= {name_value(row, *key): number for key, number in found.nodes.items()}
        names = list_values()
        return Measured({name: values[name] for name in names}, {n: nodes[n] for n in names})


class Measurement:
    """All metrics of one model on one truth that is held in memory.

    Args:
        truth: of N nodes.
        expectation: of the same nodes.
    """

    def __init__(self, truth: Truth, expectation: Expectation) -> None:
        self.prediction = Prediction(truth, expectation)
        self.scene_ids = truth.scene_ids

    def measure(self, weights: Weights) -> Measured:
        """Return every metric under some weights of the buildings, `[B, W]`."""
        streamed = StreamedMeasurement(self.scene_ids, weights)
        streamed.add(self.prediction.truth, self.prediction.expectation)
        return streamed.finish()

    def evaluate(self, building_weights: Floats | None = None) -> dict[str, float]:
        """Return every metric by name, e.g. `rooms/wasserstein_values/mean`.

        Args:
            building_weights: `[B]` how often each building counts; None counts each once.
        """
        weights = np.ones(len(self.scene_ids)) if building_weights is None else building_weights
        return self.measure(weights[:, None]).bootstrap().point

    def count_nodes(self, metric: str) -> int:
        """Return the number of nodes behind a metric."""
        return self._plain.nodes[metric]

    @cached_property
    def _plain(self) -> Measured:
        return self.measure(np.ones((len(self.scene_ids), 1)))


class SplitWeights:
    """The weights of the buildings of several splits; a building has one weight in all of them.

    Args:
        splits: scene ids of the buildings of each.
        resamples: fewer than 2 give no intervals.
        seed: of the resamples.
    """

    def __init__(self, splits: Sequence[Sequence[str]], *, resamples: int, seed: int) -> None:
        every = {scene for split in splits for scene in split}
        scene_ids = tuple(splits[0]) if len(splits) == 1 else tuple(sorted(every))
        number = {scene: place for place, scene in enumerate(scene_ids)}
        self._weights = weigh_buildings(len(scene_ids), resamples=resamples, seed=seed)
        self._places = [np.array([number[scene] for scene in split]) for split in splits]

    def of_split(self, split: int) -> Weights:
        """Return the weights of the buildings of a split, `[B, 1 + resamples]`."""
        if len(self._places) == 1:
            return self._weights
        return np.asarray(self._weights[self._places[split]])

    def average(self, splits: Sequence[Measured]) -> Measured:
        """Return the mean over the splits in which a metric is defined.

        Scores of models trained separately for each split cannot be pooled: a ranking or
        correlation over two trainings describes neither. If a resample has no building of a split,
        that split is left out of the resample's mean.
        """
        if len(splits) == 1:
            return splits[0]
        there = np.stack([self._weights[places].any(axis=0) for places in self._places])
        return Measured(
            {
                name: _mean_known(np.stack([one.values[name] for one in splits]), there)
                for name in splits[0].values
            },
            {name: sum(one.nodes[name] for one in splits) for name in splits[0].nodes},
        )


def _mean_known(values: Floats, there: Bools) -> Floats:
    """Return the mean over splits, `[W]` of `[S, W]`, of the values that exist and are not nan."""
    columns = np.where(there, values, np.nan).T
    return np.array([metrics.mean_known(column.tolist()) for column in columns])


def measure_metric(name: str, prediction: Prediction, weights: Weights) -> Values:
    """Return a row of `METRICS` for a whole prediction, under weights of its buildings `[B, W]`."""
    stream = Stream(prediction.truth.scene_ids, weights)
    accumulator = METRICS[name].start(stream)
    accumulator.add(stream.batch(prediction))
    found = accumulator.finish()
    _require_parts(name, found.nodes)
    return found


def _require_parts(name: str, nodes: Mapping[Key, int]) -> None:
    metric = METRICS[name]
    expected = {(node_set, part) for node_set in metric.node_sets for part in metric.parts}
    if set(nodes) != expected:
        raise RecipeError(
            f"metric {name!r}: expected the values {sorted(expected)} that its node sets and parts "
            f"say, found {sorted(nodes)}"
        )


def count_empty(truth: Truth) -> dict[str, int]:
    """Count the nodes with an all-zero input or target: their distances are degenerate."""
    return {
        "empty_inputs": int((truth.inputs.sum(axis=1) == 0).sum()),
        "empty_targets": int((truth.targets.sum(axis=1) == 0).sum()),
    }
