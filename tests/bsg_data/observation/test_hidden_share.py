"""What a robot believes of the share that it has not seen."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import beta

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import ShareBelief


def test_a_vague_share_is_uniform() -> None:
    assert ShareBelief(0.5, 1 / math.sqrt(12)).beta == pytest.approx((1, 1))


@given(mean=st.floats(0.01, 0.99), part=st.floats(0.01, 0.99))
def test_the_beta_has_the_moments(mean: float, part: float) -> None:
    sd = part * math.sqrt(mean * (1 - mean))
    found = beta(*ShareBelief(mean, sd).beta)
    assert found.mean() == pytest.approx(mean)
    assert found.std() == pytest.approx(sd)


@pytest.mark.parametrize(
    ("mean", "sd", "expected"),
    [
        (1.2, 0.0, "expected 0 to 1, found 1.2"),
        (math.nan, 0.0, "expected 0 to 1, found nan"),
        (0.5, 0.5, "expected 0, or less than 0.5, found 0.5"),
        (0.5, -0.1, "less than 0.5, found -0.1"),
        (0.5, math.nan, "less than 0.5, found nan"),
        (1.0, 0.1, "of a hidden share of 1: expected 0, or less than 0, found 0.1"),
    ],
)
def test_what_no_beta_has_is_refused(mean: float, sd: float, expected: str) -> None:
    with pytest.raises(RecipeError, match=expected):
        ShareBelief(mean, sd)
