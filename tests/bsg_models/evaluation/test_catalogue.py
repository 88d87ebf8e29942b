"""The table of metrics: names, order, labels, and a metric of somebody else."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from bsg_data import registry
from bsg_data.arrays import Floats
from bsg_data.errors import RecipeError
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.catalogue import (
    METRICS,
    find_value,
    head_value,
    label_value,
    list_values,
)
from bsg_models.evaluation.measurement import Fold, _measure_fold
from bsg_models.evaluation.metric_kinds import NodeMetric, PooledMetric, Tally
from bsg_models.evaluation.truth import Prediction, Truth
from bsg_models.testing import MetricContract


def overshoot(truth: Truth, expectation: Expectation) -> Floats:
    """Return by how many objects a node is expected to hold too many, `[N]`."""
    return np.maximum(expectation.total - truth.targets.sum(axis=1), 0)


OVERSHOOT = NodeMetric(label="overshoot", less=True, about="objects too many", values=overshoot)


def gini(tally: Tally, node_set: str, part: str) -> Floats:
    """Return 2 AUROC − 1, `[W]`."""
    return np.asarray(2 * tally.cells[node_set].ranks.auroc[part][0] - 1)


GINI = PooledMetric(label="Gini", less=False, about="2 AUROC − 1", measure=gini)


def evaluate(
    prediction: Prediction, weights: Sequence[float] = (1.0, 1.0, 1.0)
) -> tuple[dict[str, float], dict[str, int]]:
    truth = prediction.truth
    fold = Fold(truth.scene_ids, [(truth, prediction.expectation)])
    ((values, nodes),) = _measure_fold([fold], np.array(weights)[:, None])
    return {name: float(value[0]) for name, value in values.items()}, nodes


@pytest.fixture
def prediction() -> Prediction:
    return MetricContract().prediction()


def test_every_value_has_a_label_of_its_own() -> None:
    labels = [label_value(name) for name in list_values()]
    assert len(set(labels)) == len(labels)
    assert label_value("building/energy_values/variance") == "variance of energy, building"
    assert head_value("rooms/presence_auroc_macro/unvisited") == "unvisited AUROC macro ↑"
    assert label_value("building/presence_brier/unseen") == "unseen Brier score, building"
    assert head_value("rooms/mean_error") == "signed error in number, rooms"


@pytest.mark.parametrize(
    "name",
    [
        "rooms/hiden_nll",
        "walls/hidden_nll",
        "building/top1_unseen",
        "building/presence_brier/unvisited",
    ],
)
def test_a_value_that_is_not_there_is_refused(name: str) -> None:
    with pytest.raises(RecipeError):
        find_value(name)


def install(monkeypatch: pytest.MonkeyPatch, target: str) -> None:
    """Let a package of somebody else name a metric of this file."""
    point = EntryPoint("overshoot", f"{__name__}:{target}", METRICS.group)
    names = {"overshoot": point}
    monkeypatch.setattr(registry, "_installed", lambda group: names)


def test_a_metric_of_somebody_else_stands_with_the_others(
    prediction: Prediction, monkeypatch: pytest.MonkeyPatch
) -> None:
    before, _ = evaluate(prediction)
    install(monkeypatch, "OVERSHOOT")
    after, nodes = evaluate(prediction)
    assert set(after) - set(before) == {f"{s}/overshoot" for s in ("rooms", "building", "all")}
    assert {name: after[name] for name in before} == pytest.approx(before, nan_ok=True)
    by_hand = overshoot(prediction.truth, prediction.expectation)[::4]
    assert after["building/overshoot"] == pytest.approx(by_hand.mean())
    weighted = evaluate(prediction, (3.0, 1.0, 0.0))[0]["building/overshoot"]
    assert weighted == pytest.approx((3 * by_hand[:2].sum() + by_hand[2:4].sum()) / 8)
    assert nodes["rooms/overshoot"] == 18
    assert head_value("rooms/overshoot") == "overshoot, rooms ↓"


def test_a_metric_may_be_any_function_of_the_tally(
    prediction: Prediction, monkeypatch: pytest.MonkeyPatch
) -> None:
    install(monkeypatch, "GINI")
    found, nodes = evaluate(prediction, (3.0, 2.0, 1.0))
    auroc = found["rooms/presence_auroc_micro/all"]
    assert found["rooms/overshoot/all"] == pytest.approx(2 * auroc - 1)
    assert nodes["rooms/overshoot/all"] == 18
