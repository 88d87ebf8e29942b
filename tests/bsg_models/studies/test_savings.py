"""What planners save, by hand and against a naive bootstrap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from bsg_models.studies.savings import WorldResult, saving_of_buildings, summarise
from bsg_models.studies.search_request import StudyRecipe
from bsg_models.studies.search_study import Study, choose_planners

Costs = tuple[Sequence[float], Sequence[float]]  # of `nearest`, and of `ratio`
RECIPE = StudyRecipe(tasks=("single",))


def by_hand(costs: Mapping[str, Costs]) -> pd.DataFrame:
    rows = [
        {"scene_id": scene, "planner": planner, "cost": cost}
        for scene, (base, ours) in costs.items()
        for planner, of in (("nearest", base), ("ratio", ours), ("routing", base))
        for cost in of
    ]
    same = {"world": "star", "task": "single", "rooms_entered": 1, "instances": 1}
    return pd.DataFrame(rows).assign(ranked_first=1.0, chance=0.5, **same)


def result_of(costs: Mapping[str, Costs], **options: Any) -> WorldResult:
    planners = choose_planners(RECIPE, {}, remote=False)
    (one,) = summarise(Study(RECIPE, (), by_hand(costs), (), {}, planners), **options)
    return one


def test_savings_by_hand() -> None:
    costs = {"a": ([4.0, 6.0], [2.0, 6.0]), "b": ([10.0], [15.0])}
    one = result_of(costs, resamples=500)
    ratio = one.savings["ratio"]
    assert ratio.saved.value == pytest.approx(1 - 23 / 20)
    assert np.isnan(ratio.saved.low)  # of two buildings there is no interval
    many = result_of({f"{scene}{i}": costs[scene] for i in range(3) for scene in "ab"})
    low, high = many.savings["ratio"].saved.low, many.savings["ratio"].saved.high
    assert many.savings["ratio"].saved.value == ratio.saved.value
    assert low == pytest.approx(1 - (8 + 5 * 15) / (10 + 5 * 10))  # five of six are b
    assert high == pytest.approx(1 - (5 * 8 + 15) / (5 * 10 + 10))
    assert ratio.mean == pytest.approx((0.5 + 0.0 - 0.5) / 3)
    assert ratio.median == 0.0
    assert (ratio.wins, ratio.ties, ratio.losses) == (1, 1, 1)
    assert ratio.beyond_routing.value == pytest.approx(ratio.saved.value)
    assert np.isnan(ratio.of_oracle.value)
    assert np.isnan(one.savings["nearest"].beyond_routing.value)
    assert (one.searches, one.buildings, one.ranked_first, one.chance) == (3, 2, 1.0, 0.5)
    assert list(saving_of_buildings(by_hand(costs)).ratio) == pytest.approx([0.2, -0.5])


def test_an_interval_is_scipys_percentile_bootstrap() -> None:
    rng = np.random.default_rng(0)
    costs = rng.uniform(5, 20, (40, 2)) * np.array([1.0, 0.8])
    one = result_of(
        {f"{i}": ([base], [ours]) for i, (base, ours) in enumerate(costs)}, resamples=4000
    )
    theirs = stats.bootstrap(
        (costs[:, 0], costs[:, 1]),
        lambda base, ours, axis: 1 - ours.sum(axis=axis) / base.sum(axis=axis),
        paired=True,
        method="percentile",
        n_resamples=4000,
        rng=np.random.default_rng(1),
    ).confidence_interval
    saved = one.savings["ratio"].saved
    assert saved.low == pytest.approx(theirs.low, abs=0.01)
    assert saved.high == pytest.approx(theirs.high, abs=0.01)
    assert saved.nodes == one.searches == 40
