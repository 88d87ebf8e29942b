"""What planners save, by hand and against a naive bootstrap."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import pytest

from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.search.catalogue import PLANNERS
from bsg_models.studies.savings import (
    WorldResult,
    saving_of_buildings,
    summarise,
    tabulate_savings,
)
from bsg_models.studies.search_request import StudyRecipe
from bsg_models.studies.search_study import Study

Costs = tuple[Sequence[float], Sequence[float]]  # of `nearest`, and of `ratio`
NAN = float("nan")
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
    planners = {name: PLANNERS[name] for name in RECIPE.all_planners}
    (result,) = summarise(Study(RECIPE, (), by_hand(costs), {}, planners), **options)
    return result


def test_savings_by_hand() -> None:
    costs = {"a": ([4.0, 6.0], [2.0, 6.0]), "b": ([10.0], [15.0])}
    shown = result_of(costs, resamples=500)
    ratio = shown.savings["ratio"]
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
    assert np.isnan(shown.savings["nearest"].beyond_routing.value)
    assert (shown.searches, shown.buildings, shown.ranked_first, shown.chance) == (
        3,
        2,
        1.0,
        0.5,
    )
    assert list(saving_of_buildings(by_hand(costs)).ratio) == pytest.approx([0.2, -0.5])


def test_what_is_unknown_is_a_dash_or_left_out() -> None:
    result = result_of({"a": ([4.0], [2.0])})
    unknown = replace(result.savings["ratio"], saved=Estimate(NAN, NAN, NAN, nodes=1))
    savings = {"nearest": result.savings["nearest"], "ratio": unknown}
    (table,) = tabulate_savings([replace(result, ranked_first=NAN, savings=savings)])
    assert "likeliest" not in table.caption
    assert [row[1] for row in table.rows] == ["0.0", "-"]
