from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from scipy import stats

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.scene.class_map import load_class_map
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.evaluation import metrics
from bsg_models.evaluation.bootstrap import bootstrap
from bsg_models.evaluation.measurement import (
    Measurement,
    SplitsMeasurement,
    count_empty,
    measure_classes,
    predict_all,
    read_truth,
)
from bsg_models.evaluation.truth import Truth
from bsg_models.inputs.graphs import read_split
from bsg_models.rendering.figures import plot_evaluation, plot_learning_curve
from bsg_models.training.learning_curve import EpochReport
from bsg_models.zoo.config import find_config
from bsg_models.zoo.construction import make_model
from bsg_models.zoo.settings import DataConfig


@pytest.fixture
def truth() -> Truth:
    """Three buildings with two draws of 1 + 3 nodes each, five classes."""
    rng = np.random.default_rng(0)
    targets = rng.poisson(1.5, (24, 5)).astype(float)
    return Truth(
        inputs=np.floor(targets * rng.random((24, 5))),
        targets=targets,
        is_building=np.arange(24) % 4 == 0,
        visited=np.arange(24) % 4 != 3,
        building=np.repeat([0, 1, 2], 8),
        draw=np.tile(np.repeat([0, 1], 4), 3),
        scene_ids=("a", "b", "c"),
    )


def believe(truth: Truth, seed: int = 1) -> Expectation:
    rng = np.random.default_rng(seed)
    return from_hidden_counts(truth.inputs, poisson(rng.gamma(1.0, 1.0, truth.inputs.shape)))


def test_metrics_of_a_measurement_are_the_plain_ones(truth: Truth) -> None:
    beliefs = believe(truth)
    found = Measurement(truth, beliefs).evaluate()
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
    frobenius = metrics.correlation_frobenius(beliefs.totals[rooms], truth.targets[rooms])
    assert found["rooms/correlation_frobenius"] == pytest.approx(frobenius)


def test_a_building_that_counts_twice_is_there_twice(truth: Truth) -> None:
    """Weights are repetitions: the seam on which every bootstrap interval rests."""
    beliefs = believe(truth)
    weighted = Measurement(truth, beliefs).evaluate(np.array([2.0, 0.0, 1.0]))
    rows = np.concatenate([np.flatnonzero(truth.building == b) for b in (0, 0, 2)])
    repeated = Truth(
        inputs=truth.inputs[rows],
        targets=truth.targets[rows],
        is_building=truth.is_building[rows],
        visited=truth.visited[rows],
        building=np.repeat([0, 1, 2], 8),
        draw=truth.draw[rows],
        scene_ids=("a", "a again", "c"),
    )
    again = Expectation(
        beliefs.inputs[rows], beliefs.hidden_counts.take(rows), beliefs.totals[rows]
    )
    expected = Measurement(repeated, again).evaluate()
    assert weighted.keys() == expected.keys()
    for name, value in weighted.items():
        assert value == pytest.approx(expected[name], nan_ok=True, abs=1e-9), name


def test_perfect_and_empty_beliefs(truth: Truth) -> None:
    perfect = Expectation(truth.inputs, poisson(truth.hidden), truth.targets)
    found = Measurement(truth, perfect).evaluate()
    for metric in ("wasserstein_values/mean", "energy_values/mean", "total_variation/mean"):
        assert found[f"all/{metric}"] == pytest.approx(0, abs=1e-9)
    assert found["all/correlation_frobenius"] == pytest.approx(0, abs=1e-9)
    assert found["rooms/presence_auroc_macro/all"] == 1
    assert found["rooms/top1_unseen"] == 1
    nothing = from_hidden_counts(truth.inputs, poisson(np.zeros_like(truth.inputs)))
    assert Measurement(truth, nothing).evaluate()["rooms/presence_auroc_macro/all"] == 0.5


def test_empty_nodes_are_counted(truth: Truth) -> None:
    truth.inputs[1] = 0
    found = count_empty(truth)
    assert found["empty_inputs"] == (truth.inputs.sum(axis=1) == 0).sum() >= 1


def test_nodes_are_counted_as_each_metric_uses_them(truth: Truth) -> None:
    beliefs = believe(truth)
    truth.targets[1] = truth.inputs[1] = 0
    measurement = Measurement(truth, beliefs)
    assert measurement.count_nodes("rooms/wasserstein_values/mean") == 18
    assert measurement.count_nodes("rooms/wasserstein_classes/mean") == 17
    wanted = (truth.hidden > 0) & (truth.inputs == 0)
    rooms = wanted[~truth.is_building].any(axis=1).sum()
    assert measurement.count_nodes("rooms/top3_unseen") == rooms


def test_errors_per_class_by_hand(truth: Truth) -> None:
    beliefs = believe(truth)
    frame = measure_classes(truth, {"m": beliefs}, list("abcde"))
    row = frame[(frame["nodes"] == "building") & (frame["class"] == "c")].iloc[0]
    error = (beliefs.totals - truth.targets)[truth.is_building, 2]
    assert row["mean_error"] == pytest.approx(error.mean())
    assert row["mean_absolute_error"] == pytest.approx(np.abs(error).mean())


def test_splits_are_averaged_and_never_pooled(dataset: Path) -> None:
    """A model that is constant per class has AUROC 0.5 in each split, and so in their mean."""
    splits = []
    for seed in (0, 1, 2):
        split_dataset(dataset, SplitRecipe(seed=seed, ratios=(0.5, 0.0, 0.5)), force=True)
        write_pairs(dataset, PairsRecipe(draws=2))
        data = Dataset.open(dataset)
        model = make_model(find_config("train-mean"), classes=45)
        model.fit(data, DataConfig())
        masked = read_split(data, "test")
        splits.append(Measurement(read_truth(masked), predict_all(model, masked)))
    every = SplitsMeasurement(splits)
    found = every.evaluate()
    assert found["rooms/presence_auroc_macro/all"] == 0.5
    assert found["rooms/presence_auroc_macro/unseen"] == 0.5
    mean = np.mean([split.evaluate()["rooms/correlation_frobenius"] for split in splits])
    assert found["rooms/correlation_frobenius"] == pytest.approx(mean)
    weights = np.arange(1.0, len(every.scene_ids) + 1)
    expected = []
    for split in splits:
        own = np.array([weights[every.scene_ids.index(scene)] for scene in split.scene_ids])
        expected.append(split.evaluate(own)["rooms/hidden_nll"])
    assert every.evaluate(weights)["rooms/hidden_nll"] == pytest.approx(np.mean(expected))
    nodes = [split.count_nodes("rooms/hidden_nll") for split in splits]
    assert every.count_nodes("rooms/hidden_nll") == sum(nodes)
    assert bootstrap(every, resamples=3).point == pytest.approx(found, nan_ok=True)


@pytest.mark.slow
def test_figures_are_drawn(truth: Truth, tmp_path: Path) -> None:
    drawn = plot_evaluation(
        tmp_path / "figures",
        name="m",
        expectation=believe(truth),
        target=truth.targets,
        is_building=truth.is_building,
        classes=load_class_map().classes[:5],
        node=0,
        building="a",
    )
    report = EpochReport(1, 1, 2.0, 3.0, 1, 0.1)
    plot_learning_curve([report], tmp_path / "curve.png", title="m", loss="loss")
    for path in (*drawn.values(), tmp_path / "curve.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
