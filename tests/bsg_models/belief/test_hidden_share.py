"""What a robot believes of the share that it has not seen."""

from __future__ import annotations

import math
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import beta

from bsg_data.errors import RecipeError
from bsg_models.belief.hidden_share import VAGUE, ShareBelief, estimate_hidden_share


@given(mean=st.floats(0.01, 0.99), part=st.floats(0.01, 0.99))
def test_the_beta_has_the_moments(mean: float, part: float) -> None:
    sd = part * math.sqrt(mean * (1 - mean))
    found = beta(*ShareBelief(mean, sd).beta)
    assert found.mean() == pytest.approx(mean)
    assert found.std() == pytest.approx(sd)


@pytest.mark.parametrize(
    ("mean", "sd"),
    [(1.2, 0.0), (math.nan, 0.0), ("x", 0.0), (0.5, "x"), (0.5, 0.5), (0.5, -0.1), (1.0, 0.1)],
)
def test_what_no_beta_has_is_refused(mean: Any, sd: Any) -> None:
    with pytest.raises(RecipeError):
        ShareBelief(mean, sd)


def test_what_was_not_looked_at_hides_all_and_a_visited_room_anything() -> None:
    assert estimate_hidden_share(visited=False) == ShareBelief(1.0)
    assert estimate_hidden_share() == VAGUE
    assert estimate_hidden_share(floor_in_view=0.0) == ShareBelief(1.0)
    assert VAGUE.beta == pytest.approx((1, 1), abs=0.01)


def test_the_floor_counts_before_the_walls_and_these_before_the_time() -> None:
    floor = estimate_hidden_share(floor_in_view=0.3)
    walls = estimate_hidden_share(walls_in_view=0.3)
    assert estimate_hidden_share(floor_in_view=0.3, walls_in_view=0.9, seconds_inside=60) == floor
    assert estimate_hidden_share(walls_in_view=0.3, seconds_inside=60, floor_area=3) == walls


@given(part=st.floats(0, 1), more=st.floats(0, 1))
def test_the_more_was_in_view_the_less_is_hidden(part: float, more: float) -> None:
    low, high = sorted((part, more))
    for name in ("floor_in_view", "walls_in_view"):
        assert (
            estimate_hidden_share(**{name: high}).mean <= estimate_hidden_share(**{name: low}).mean
        )
    waited = [estimate_hidden_share(seconds_inside=60 * x, floor_area=20) for x in (low, high)]
    assert waited[1].mean <= waited[0].mean


@pytest.mark.parametrize(
    "look",
    [
        {"floor_in_view": 1.1},
        {"walls_in_view": math.nan},
        {"walls_in_view": True},
        {"floor_in_view": "x"},
        {"seconds_inside": -1.0},
        {"seconds_inside": 10**400},
        {"seconds_inside": 1.0, "floor_area": -2.0},
        {"recall": 2.0},
        {"visited": False, "seconds_inside": 1.0},
    ],
)
def test_a_look_that_cannot_be_is_refused(look: dict[str, Any]) -> None:
    with pytest.raises(RecipeError):
        estimate_hidden_share(**look)
