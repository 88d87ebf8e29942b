from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import exact_ranks
import numpy as np
import pytest
from scipy import stats

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation import metrics
from bsg_models.evaluation.bootstrap import Bootstrap, weigh_buildings
from bsg_models.evaluation.catalogue import head_value, label_value, list_values
from bsg_models.evaluation.details import Details
from bsg_models.evaluation.measurement import Fold, measure, measure_fold, predict_all, read_truth
from bsg_models.evaluation.truth import Prediction, Truth
from bsg_models.inputs.graphs import read_split
from bsg_models.testing import MetricContract
from bsg_models.zoo.config import find_config
from bsg_models.zoo.model import make_model
from bsg_models.zoo.settings import DataConfig


@pytest.fixture
def truth() -> Truth:
    """Three buildings with two draws of 1 + 3 nodes each, five classes."""
    return MetricContract().prediction().truth


def believe(truth: Truth, seed: int = 1) -> Expectation:
    rng = np.random.default_rng(seed)
    return Expectation(truth.inputs, poisson(rng.gamma(1.0, 1.0, truth.inputs.shape)))


def evaluate(
    truth: Truth, expectation: Expectation, weights: np.ndarray | None = None
) -> tuple[dict[str, float], dict[str, int]]:
    """Return every metric under one weight for each building, and the nodes behind it."""
    each = np.ones(len(truth.scene_ids)) if weights is None else weights
    fold = Fold(truth.scene_ids, [{"": Prediction(truth, expectation)}])
    values = measure_fold(fold, each[:, None])[""]
    return (
        {name: float(value.weighted[0]) for name, value in values.items()},
        {name: value.nodes for name, value in values.items()},
    )


def measure_one(folds: list[Prediction], *, resamples: int) -> Bootstrap:
    """Return the metrics of one model whose folds have these predictions."""
    each = [Fold(fold.truth.scene_ids, [{"": fold}]) for fold in folds]
    return measure(each, resamples=resamples)[""]


def test_every_value_has_a_label_of_its_own() -> None:
    labels = [label_value(name) for name in list_values()]
    assert len(set(labels)) == len(labels)
    assert label_value("building/energy_values/variance") == "variance of energy, building"
    assert head_value("rooms/presence_auroc_macro/unvisited") == "unvisited AUROC macro ↑"


def test_metrics_of_a_measurement_are_the_plain_ones(truth: Truth) -> None:
    beliefs = believe(truth)
    found, _ = evaluate(truth, beliefs)
    rooms = ~truth.is_building
    p, q = metrics.normalise(beliefs.totals), metrics.normalise(truth.targets)
    distances = [stats.wasserstein_distance(a, b) for a, b in zip(p[rooms], q[rooms], strict=True)]
    assert found["rooms/wasserstein_values/mean"] == pytest.approx(np.mean(distances))
    assert found["rooms/wasserstein_values/kurtosis"] == pytest.approx(stats.kurtosis(distances))
    nll = -stats.poisson.logpmf(truth.hidden, beliefs.hidden)
    assert found["building/hidden_nll"] == pytest.approx(nll[~rooms].mean())
    hidden = truth.hidden[rooms] > 0
    presence = beliefs.presence[rooms]
    wins = stats.mannwhitneyu(presence[hidden], presence[~hidden]).statistic
    expected = wins / (hidden.sum() * (~hidden).sum())
    assert found["rooms/presence_auroc_micro/all"] == pytest.approx(expected)
    matrices = (metrics.correlation_matrix(x[rooms]) for x in (beliefs.totals, truth.targets))
    frobenius = np.linalg.norm(np.subtract(*matrices))
    assert found["rooms/correlation_frobenius"] == pytest.approx(frobenius)


def test_errors_per_class_by_hand(truth: Truth) -> None:
    beliefs = believe(truth)
    errors = Details()
    errors.add(Prediction(truth, beliefs))
    frame = errors.tabulate("m", list("abcde"))
    row = frame[(frame["nodes"] == "building") & (frame["class"] == "c")].iloc[0]
    error = (beliefs.totals - truth.targets)[truth.is_building, 2]
    assert row["mean_error"] == pytest.approx(error.mean())
    assert row["mean_absolute_error"] == pytest.approx(np.abs(error).mean())
    rooms = ~truth.is_building
    cells = (beliefs.presence[rooms, 2], truth.hidden[rooms, 2] > 0, np.ones(rooms.sum()))
    row = frame[(frame["nodes"] == "rooms") & (frame["class"] == "c")].iloc[0]
    assert row["presence_auroc"] == pytest.approx(exact_ranks.auroc(*cells))
    assert row["presence_ap"] == pytest.approx(exact_ranks.average_precision(*cells))


def test_folds_are_averaged_and_never_pooled(dataset: Path) -> None:
    """A model that is constant per class has AUROC 0.5 in each fold, and so in their mean."""
    folds = []
    for seed in (0, 1, 2):
        split_dataset(dataset, SplitRecipe(seed=seed, ratios=(0.5, 0.0, 0.5)), force=True)
        write_pairs(dataset, PairsRecipe(draws=2))
        data = Dataset.open(dataset)
        model = make_model(find_config("train-mean"), classes=45)
        model.fit(data, DataConfig())
        masked = read_split(data, "test")
        folds.append((read_truth(masked), predict_all(model, masked)))
    every = measure_one([Prediction(*pair) for pair in folds], resamples=2)
    assert every.point["rooms/presence_auroc_macro/all"] == 0.5
    assert every.point["rooms/presence_auroc_macro/unseen"] == 0.5
    alone = [evaluate(*pair) for pair in folds]
    name = "rooms/correlation_frobenius"
    assert every.point[name] == pytest.approx(np.mean([pair[name] for pair, _ in alone]))
    # A building that is in several folds has one weight in all.
    scenes = sorted({scene for truth, _ in folds for scene in truth.scene_ids})
    resample = dict(zip(scenes, weigh_buildings(len(scenes), resamples=2, seed=0), strict=True))
    weights = [np.array([float(resample[s][2]) for s in truth.scene_ids]) for truth, _ in folds]
    name = "rooms/hidden_nll"
    expected = [evaluate(*pair, own)[0][name] for pair, own in zip(folds, weights, strict=True)]
    assert every.resampled[name][1] == pytest.approx(np.mean(expected))
    assert every.nodes[name] == sum(nodes[name] for _, nodes in alone)


def test_a_fold_without_a_building_of_the_resample_is_not_in_its_mean(truth: Truth) -> None:
    beliefs, name = believe(truth), "rooms/hidden_nll"
    parts = []
    for building, scene in enumerate(truth.scene_ids[:2]):
        rows = np.flatnonzero(truth.building == building)
        own = replace(
            truth,
            inputs=truth.inputs[rows],
            targets=truth.targets[rows],
            is_building=truth.is_building[rows],
            visited=truth.visited[rows],
            building=np.zeros(len(rows), dtype=np.int64),
            draw=truth.draw[rows],
            scene_ids=(scene,),
        )
        parts.append((own, beliefs.take(rows)))
    found = measure_one([Prediction(*part) for part in parts], resamples=20)
    first, second = (evaluate(*part)[0][name] for part in parts)
    assert found.point[name] == pytest.approx((first + second) / 2)
    ends = {round(value, 9) for value in found.resampled[name].tolist()}
    assert ends == {round(value, 9) for value in (first, second, (first + second) / 2)}


@pytest.mark.parametrize(
    ("stride", "nodes", "example"),
    [(1, [0, 1, 2, 3, 4, 5, 6, 7, 8, 9], 4), (3, [0, 1, 4, 5, 6, 7], 2), (9, [0, 1, 4, 5], 2)],
)
def test_every_kth_masked_building_is_kept_and_the_example(
    stride: int, nodes: list[int], example: int
) -> None:
    """Five masked buildings of two nodes: of a, d, c, and two draws of b, in two batches."""
    targets, collector = np.arange(10.0)[:, None], Details(stride, "c")
    for rows, building, scenes in (
        (np.arange(4), [0, 0, 1, 1], ("a", "d")),
        (np.arange(4, 10), [0, 0, 1, 1, 1, 1], ("c", "b")),
    ):
        truth = Truth(
            inputs=targets[rows],
            targets=targets[rows],
            is_building=rows % 2 == 0,
            visited=np.ones(len(rows), dtype=bool),
            building=np.array(building),
            draw=np.zeros(len(rows), dtype=np.int64),
            scene_ids=scenes,
        )
        collector.add(Prediction(truth, Expectation(truth.inputs, poisson(truth.inputs))))
    shown = collector.shown()
    assert shown.targets[:, 0].tolist() == nodes
    assert shown.totals[:, 0].tolist() == [2 * node for node in nodes]
    assert shown.targets[shown.example, 0] == 4
    assert shown.example == example
