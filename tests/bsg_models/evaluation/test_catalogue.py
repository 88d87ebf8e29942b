"""The table of metrics: names, order, labels, and a metric of somebody else."""

from __future__ import annotations

import doctest
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from bsg_data import registry
from bsg_data.errors import RecipeError
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.evaluation import catalogue
from bsg_models.evaluation.catalogue import (
    METRICS,
    find_value,
    head_value,
    label_value,
    list_values,
)
from bsg_models.evaluation.measurement import Measurement
from bsg_models.evaluation.metric_kinds import NodeMetric, WholeMetric
from bsg_models.evaluation.metrics import Floats
from bsg_models.evaluation.truth import Prediction, Truth


def overshoot(truth: Truth, expectation: Expectation) -> Floats:
    """Return by how many objects a node is expected to hold too many, `[N]`."""
    return np.maximum(expectation.total - truth.targets.sum(axis=1), 0)


OVERSHOOT = NodeMetric(label="overshoot", less=True, about="objects too many", values=overshoot)


class Sharpest(WholeMetric):
    """The greatest presence in a building that counts: a function of the weights."""

    @property
    def node_sets(self) -> tuple[str, ...]:
        return ("building",)

    def measure(self, prediction: Prediction, weights: Floats) -> dict[tuple[str, str], float]:
        rows = prediction.rows["building"]
        presence = prediction.expectation.presence[rows].max(axis=1)
        return {("building", self.label): float(presence[weights[rows] > 0].max())}


SHARPEST = Sharpest(label="", less=False, about="greatest presence")
LYING = Sharpest(label="lying", less=False, about="says another part than it has")
RAGGED = NodeMetric(label="ragged", less=True, about="no", values=lambda t, e: t.targets)


@pytest.fixture
def measurement() -> Measurement:
    """Two buildings of 1 + 2 nodes and three classes; the second room was never entered."""
    rng = np.random.default_rng(0)
    targets = rng.poisson(2, (6, 3)).astype(float)
    truth = Truth(
        inputs=np.floor(targets / 2),
        targets=targets,
        is_building=np.arange(6) % 3 == 0,
        visited=np.arange(6) % 3 != 2,
        building=np.repeat([0, 1], 3),
        draw=np.zeros(6, dtype=np.int64),
        scene_ids=("a", "b"),
    )
    return Measurement(truth, from_hidden_counts(truth.inputs, poisson(rng.random((6, 3)))))


def test_doctests() -> None:
    result = doctest.testmod(catalogue)
    assert result.attempted >= 3
    assert result.failed == 0


def test_a_measurement_has_the_values_of_the_table_in_their_order(
    measurement: Measurement,
) -> None:
    assert tuple(measurement.evaluate()) == list_values()
    assert list_values()[:2] == (
        "rooms/wasserstein_values/mean",
        "rooms/wasserstein_values/variance",
    )
    assert list_values()[24] == "building/wasserstein_values/mean"
    assert list_values()[72] == "rooms/presence_auroc_micro/all"
    assert list_values()[78] == "rooms/presence_auroc_micro/unseen"
    assert list_values()[-3:] == ("rooms/top1_unseen", "rooms/top3_unseen", "rooms/top5_unseen")
    assert len(set(list_values())) == len(list_values()) == 93


def test_every_value_has_a_label_of_its_own() -> None:
    labels = [label_value(name) for name in list_values()]
    assert len(set(labels)) == len(labels)
    assert label_value("building/energy_values/variance") == "variance of energy, building"
    assert head_value("rooms/presence_auroc_macro/unvisited") == "unvisited AUROC macro ↑"
    assert head_value("rooms/mean_error") == "signed error in number, rooms"


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("rooms/hiden_nll", "did you mean hidden_nll"),
        ("walls/hidden_nll", "has no value 'walls/hidden_nll'"),
        ("rooms/presence_brier", "rooms/presence_brier/unseen"),
        ("building/top1_unseen", "it has rooms/top1_unseen"),
    ],
)
def test_a_value_that_is_not_there_is_said(name: str, words: str) -> None:
    with pytest.raises(RecipeError, match=words):
        find_value(name)


def install(monkeypatch: pytest.MonkeyPatch, target: str) -> None:
    """Let a package of somebody else name a metric of this file."""
    point = EntryPoint("overshoot", f"{__name__}:{target}", METRICS.group)
    names = {"overshoot": point}
    monkeypatch.setattr(registry, "_installed", lambda group: names)


def test_a_metric_of_somebody_else_stands_with_the_others(
    measurement: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    before = measurement.evaluate()
    install(monkeypatch, "OVERSHOOT")
    again = Measurement(measurement.prediction.truth, measurement.prediction.expectation)
    after = again.evaluate()
    assert set(after) - set(before) == {f"{s}/overshoot" for s in ("rooms", "building", "all")}
    assert {name: after[name] for name in before} == pytest.approx(before, nan_ok=True)
    truth, expectation = again.prediction.truth, again.prediction.expectation
    by_hand = overshoot(truth, expectation)[[0, 3]]
    assert after["building/overshoot"] == pytest.approx(by_hand.mean())
    weighted = again.evaluate(np.array([3.0, 1.0]))["building/overshoot"]
    assert weighted == pytest.approx((3 * by_hand[0] + by_hand[1]) / 4)
    assert again.count_nodes("rooms/overshoot") == 4
    assert head_value("rooms/overshoot") == "overshoot, rooms ↓"


def test_a_metric_may_be_any_function_of_the_weights(
    measurement: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, "SHARPEST")
    truth, expectation = measurement.prediction.truth, measurement.prediction.expectation
    again = Measurement(truth, expectation)
    of_second = expectation.presence[3].max()
    assert again.evaluate(np.array([0.0, 2.0]))["building/overshoot"] == of_second
    assert list(again.evaluate())[-1] == "building/overshoot"
    install(monkeypatch, "LYING")
    with pytest.raises(RecipeError, match="'overshoot': expected the values"):
        Measurement(truth, expectation).evaluate()


def test_a_metric_of_another_shape_is_refused(
    measurement: Measurement, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, "RAGGED")
    again = Measurement(measurement.prediction.truth, measurement.prediction.expectation)
    with pytest.raises(RecipeError, match=r"'ragged': expected a value for each of 6 nodes"):
        again.evaluate()
