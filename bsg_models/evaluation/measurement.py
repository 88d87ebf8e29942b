"""Measure models on the stored pairs of a split: every metric, for any weights of the buildings."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cached_property

import numpy as np
import pandas as pd

from bsg_data.errors import RecipeError
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.expectation import Expectation, join
from bsg_models.evaluation import metrics
from bsg_models.evaluation.catalogue import METRICS, list_values, name_value
from bsg_models.evaluation.metric_kinds import Prepared
from bsg_models.evaluation.metrics import Floats
from bsg_models.evaluation.truth import Prediction, Truth
from bsg_models.zoo.model import BeliefModel

# Of the metrics and of how predictions are read: it rises when the same predictions would get
# another value, so that results of one version can be compared.
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


class Measurement:
    """All metrics of one model on one truth.

    What does not depend on the weights (distances, sorted scores) is computed once.
    """

    def __init__(self, truth: Truth, expectation: Expectation) -> None:
        self.prediction = Prediction(truth, expectation)
        self.scene_ids = truth.scene_ids

    def evaluate(self, building_weights: Floats | None = None) -> dict[str, float]:
        """Return every metric by name, e.g. `rooms/wasserstein_values/mean`.

        Args:
            building_weights: `[B]` how often each building counts; None counts each once.
        """
        weights = np.ones(len(self.scene_ids)) if building_weights is None else building_weights
        values = {
            name_value(row, *key): value
            for row, prepared in self._prepared.items()
            for key, value in prepared.evaluate(weights).items()
        }
        return {name: values[name] for name in self._nodes}

    def count_nodes(self, metric: str) -> int:
        """Return the number of nodes that a metric is over."""
        return self._nodes[metric]

    @cached_property
    def _prepared(self) -> Mapping[str, Prepared]:
        return {name: prepare_metric(name, self.prediction) for name in METRICS.load_all()[0]}

    @cached_property
    def _nodes(self) -> Mapping[str, int]:
        """Name → number of nodes, in the order of all tables."""
        nodes = {
            name_value(row, *key): number
            for row, prepared in self._prepared.items()
            for key, number in prepared.nodes.items()
        }
        return {name: nodes[name] for name in list_values()}


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
        values = [
            split.evaluate(weights[places])
            for split, places in zip(self.splits, self._places, strict=True)
            if weights[places].any()
        ]
        return {name: metrics.mean_known([one[name] for one in values]) for name in values[0]}

    def count_nodes(self, metric: str) -> int:
        """Return the number of nodes of all splits that a metric is over."""
        return sum(split.count_nodes(metric) for split in self.splits)


def prepare_metric(name: str, prediction: Prediction) -> Prepared:
    """Prepare a row of `METRICS` for a prediction.

    Raises:
        RecipeError: if it has other node sets or parts than it says, as somebody else's may.
    """
    metric = METRICS[name]
    prepared = metric.prepare(prediction)
    expected = {(node_set, part) for node_set in metric.node_sets for part in metric.parts}
    if set(prepared.nodes) != expected:
        raise RecipeError(
            f"metric {name!r}: expected the values {sorted(expected)} that its node sets and parts "
            f"say, found {sorted(prepared.nodes)}"
        )
    return prepared


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
    for model, expectation in expectations.items():
        error = expectation.totals - truth.targets
        presence = expectation.presence
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
