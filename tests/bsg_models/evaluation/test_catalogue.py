"""The table of metrics: names, order, labels, and a metric of somebody else."""

from __future__ import annotations

from collections.abc import Sequence
from importlib.metadata import EntryPoint

import numpy as np
import pytest

from bsg_data import registry
from bsg_data.arrays import Floats
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.catalogue import (
    METRICS,
    head_value,
    label_value,
    list_values,
)
from bsg_models.evaluation.measurement import Fold, measure_fold
from bsg_models.evaluation.metric import NodeMetric
from bsg_models.evaluation.truth import Prediction, Truth
from bsg_models.testing import MetricContract


def overshoot(truth: Truth, expectation: Expectation) -> Floats:
    """Return by how many objects a node is expected to hold too many, `[N]`."""
    return np.maximum(expectation.total - truth.targets.sum(axis=1), 0)


OVERSHOOT = NodeMetric(label="overshoot", less=True, about="objects too many", values=overshoot)
POINT = EntryPoint("overshoot", f"{__name__}:OVERSHOOT", METRICS.group)


def evaluate(
    prediction: Prediction, weights: Sequence[float] = (1.0, 1.0, 1.0)
) -> dict[str, tuple[float, int]]:
    fold = Fold(prediction.truth.scene_ids, [{"": prediction}])
    values = measure_fold(fold, np.array(weights)[:, None])[""]
    return {name: (float(value[0]), nodes) for name, (value, nodes) in values.items()}


def test_every_value_has_a_label_of_its_own() -> None:
    labels = [label_value(name) for name in list_values()]
    assert len(set(labels)) == len(labels)
    assert label_value("building/energy_values/variance") == "variance of energy, building"
    assert head_value("rooms/presence_auroc_macro/unvisited") == "unvisited AUROC macro ↑"
    assert label_value("building/presence_brier/unseen") == "unseen Brier score, building"


def test_a_metric_of_somebody_else_stands_with_the_others(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    prediction = MetricContract().prediction()
    before = evaluate(prediction)
    monkeypatch.setattr(registry, "_installed", lambda group: {"overshoot": POINT})
    after = evaluate(prediction)
    assert set(after) - set(before) == {f"{s}/overshoot" for s in ("rooms", "building", "all")}
    assert {name: after[name][0] for name in before} == pytest.approx(
        {name: value for name, (value, _) in before.items()}, nan_ok=True
    )
    by_hand = overshoot(prediction.truth, prediction.expectation)[::4]
    assert after["building/overshoot"][0] == pytest.approx(by_hand.mean())
    weighted, _ = evaluate(prediction, (3.0, 1.0, 0.0))["building/overshoot"]
    assert weighted == pytest.approx((3 * by_hand[:2].sum() + by_hand[2:4].sum()) / 8)
    assert after["rooms/overshoot"][1] == 18
    assert head_value("rooms/overshoot") == "overshoot, rooms ↓"
