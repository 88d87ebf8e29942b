from __future__ import annotations

from pathlib import Path

import exact_ranks
import numpy as np
import pandas as pd
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
from bsg_models.evaluation.bootstrap import weigh_buildings
from bsg_models.evaluation.class_errors import ClassErrors
from bsg_models.evaluation.measurement import (
    Measured,
    Measurement,
    SplitWeights,
    StreamedMeasurement,
    count_empty,
    predict_all,
    read_truth,
)
from bsg_models.evaluation.shown_nodes import ShownNodes
from bsg_models.evaluation.truth import Truth
from bsg_models.inputs.graphs import read_split
from bsg_models.rendering.figures import plot_evaluation, plot_learning_curve
from bsg_models.training.learning_curve import EpochReport
from bsg_models.zoo.config import find_config
from bsg_models.zoo.ensemble import make_model
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
    matrices = (metrics.correlation_matrix(x[rooms]) for x in (beliefs.totals, truth.targets))
    frobenius = np.linalg.norm(np.subtract(*matrices))
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
    errors = ClassErrors()
    errors.add(truth, beliefs)
    frame = pd.DataFrame(errors.rows("m", list("abcde")))
    row = frame[(frame["nodes"] == "building") & (frame["class"] == "c")].iloc[0]
    error = (beliefs.totals - truth.targets)[truth.is_building, 2]
    assert row["mean_error"] == pytest.approx(error.mean())
    assert row["mean_absolute_error"] == pytest.approx(np.abs(error).mean())
    rooms = ~truth.is_building
    cells = (beliefs.presence[rooms, 2], truth.hidden[rooms, 2] > 0, np.ones(rooms.sum()))
    row = frame[(frame["nodes"] == "rooms") & (frame["class"] == "c")].iloc[0]
    assert row["presence_auroc"] == pytest.approx(exact_ranks.auroc(*cells))
    assert row["presence_ap"] == pytest.approx(exact_ranks.average_precision(*cells))


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
    weights = SplitWeights([split.scene_ids for split in splits], resamples=2, seed=0)
    each = [split.measure(weights.of_split(number)) for number, split in enumerate(splits)]
    every = weights.average(each).bootstrap()
    assert every.point["rooms/presence_auroc_macro/all"] == 0.5
    assert every.point["rooms/presence_auroc_macro/unseen"] == 0.5
    alone = [split.evaluate() for split in splits]
    name = "rooms/correlation_frobenius"
    assert every.point[name] == pytest.approx(np.mean([one[name] for one in alone]))
    # A building that is in several splits has one weight in all.
    scenes = sorted({scene for split in splits for scene in split.scene_ids})
    resample = dict(zip(scenes, weigh_buildings(len(scenes), resamples=2, seed=0), strict=True))
    expected = [
        split.evaluate(np.array([resample[scene][2] for scene in split.scene_ids], dtype=float))
        for split in splits
    ]
    mean = np.mean([one["rooms/hidden_nll"] for one in expected])
    assert every.resampled["rooms/hidden_nll"][1] == pytest.approx(mean)
    nodes = [split.count_nodes("rooms/hidden_nll") for split in splits]
    assert every.nodes["rooms/hidden_nll"] == sum(nodes)


def test_a_split_without_a_building_of_the_resample_is_not_in_its_mean(truth: Truth) -> None:
    weights = SplitWeights([("a",), ("b",)], resamples=20, seed=0)
    measured = [Measured({"x": np.full(21, value)}, {"x": 1}) for value in (1.0, 3.0)]
    found = weights.average(measured).values["x"]
    assert found[0] == 2
    assert set(found) == {1.0, 2.0, 3.0}


def test_batches_and_their_order_do_not_matter(truth: Truth) -> None:
    beliefs, weights = believe(truth), weigh_buildings(3, resamples=5, seed=0)
    whole = Measurement(truth, beliefs).measure(weights)
    streamed = StreamedMeasurement(truth.scene_ids, weights)
    for first in (16, 0, 4, 20, 8, 12):  # the draws of a building in two batches
        rows = np.arange(first, first + 4)
        some = Truth(
            inputs=truth.inputs[rows],
            targets=truth.targets[rows],
            is_building=truth.is_building[rows],
            visited=truth.visited[rows],
            building=np.zeros(4, dtype=np.int64),
            draw=truth.draw[rows],
            scene_ids=(truth.scene_ids[first // 8],),
        )
        streamed.add(some, beliefs.take(rows))
    found = streamed.finish()
    assert found.nodes == whole.nodes
    for name, value in whole.values.items():
        np.testing.assert_allclose(found.values[name], value, rtol=1e-9, atol=1e-12, err_msg=name)


def test_figures_are_drawn(truth: Truth, tmp_path: Path) -> None:
    notes: list[str] = []
    drawn = plot_evaluation(
        tmp_path / "figures",
        name="m",
        shown=ShownNodes(
            truth.inputs, believe(truth).totals, truth.targets, truth.is_building, example=0
        ),
        classes=load_class_map().classes[:5],
        building="a",
        notes=notes,
    )
    assert notes == []
    report = EpochReport(1, 1, 2.0, 3.0, 1, 0.1)
    plot_learning_curve([report], tmp_path / "curve.png", title="m", loss="loss")
    for path in (*drawn.values(), tmp_path / "curve.png"):
        assert path.read_bytes().startswith(b"\x89PNG")
