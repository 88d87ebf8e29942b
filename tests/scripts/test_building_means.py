"""Means of buildings: by hand, and the same as over all nodes."""

from __future__ import annotations

import numpy as np
import pytest
from building_means import join_buildings, sum_buildings

from bsg_data.errors import RecipeError
from bsg_models.evaluation.bootstrap import bootstrap

VALUES, CELLS = np.array([1.0, 3.0, 5.0]), np.array([1.0, 1.0, 2.0])
FIRST = sum_buildings(("b", "a"), np.array([0, 0, 1]), {"x": (VALUES, CELLS)})
SECOND = sum_buildings(("c",), np.array([0]), {"x": (np.array([8.0]), np.array([1.0]))})


def test_parts_are_pooled_or_averaged() -> None:
    pooled = join_buildings([FIRST, SECOND])
    assert pooled.scene_ids == ("a", "b", "c")
    assert pooled.evaluate()["x"] == 17 / 5
    assert pooled.count_nodes("x") == 5
    assert join_buildings([FIRST, SECOND], by_fold=True).evaluate()["x"] == (9 / 4 + 8) / 2


def test_a_weight_repeats_a_building() -> None:
    pooled = join_buildings([FIRST, SECOND])
    assert pooled.evaluate(np.array([2.0, 0.0, 1.0]))["x"] == (2 * 5 + 8) / (2 * 2 + 1)


def test_without_cells_a_mean_is_not_defined() -> None:
    none = sum_buildings(("a",), np.array([0]), {"x": (np.array([0.0]), np.array([0.0]))})
    assert np.isnan(none.evaluate()["x"])
    both = join_buildings([SECOND, none], by_fold=True)
    assert both.evaluate()["x"] == 8.0  # over the fold in which it is defined


def test_equal_models_differ_by_nothing() -> None:
    one = bootstrap(join_buildings([FIRST, SECOND]), resamples=20)
    gap = one.difference(one, "x")
    assert (gap.value, gap.low, gap.high, gap.nodes) == (0.0, 0.0, 0.0, 5)


def test_a_building_in_two_folds_is_refused() -> None:
    with pytest.raises(RecipeError, match="building c is tested on twice"):
        join_buildings([SECOND, SECOND])
