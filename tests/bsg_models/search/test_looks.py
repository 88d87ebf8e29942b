"""What a look costs, and what looks that are repeated miss."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.stats import gamma

from bsg_models.search.looks import PIECE, ROOM, look_again, metres_of_look, miss_all

CHANCES = st.lists(st.floats(0, 0.99), max_size=5)


def test_a_look_costs_more_in_a_larger_room_of_which_more_is_left() -> None:
    sizes = [metres_of_look(area) for area in (3.0, 6.0, 12.0, 24.0)]
    assert sizes == sorted(sizes)
    assert metres_of_look(None) == metres_of_look(12.0)
    assert metres_of_look(12.0, share=0.5) == pytest.approx(metres_of_look(12.0) / 2)
    assert metres_of_look(12.0, share=0.0) == 1.0


@given(CHANCES, st.sampled_from([ROOM, PIECE]))
def test_places_are_seen_at_rates_that_are_spread_by_a_gamma(
    chances: list[float], shape: float
) -> None:
    """A look misses a place of rate λ with e^(−λ a), where a single one misses 1 − c."""
    efforts = [(1 - c) ** (-1 / shape) - 1 for c in chances]
    rates = gamma(shape)
    alone = [rates.expect(lambda rate, a=a: np.exp(-rate * a), ub=60) for a in efforts]
    assert alone == pytest.approx([1 - c for c in chances], abs=1e-3)
    total = rates.expect(lambda rate: np.exp(-rate * sum(efforts)), ub=60)
    assert miss_all(chances, shape=shape) == pytest.approx(total, abs=1e-3)


@given(CHANCES, st.floats(0.01, 0.99))
def test_a_further_look_finds_less_than_the_one_before_and_looks_follow_each_other(
    before: list[float], chance: float
) -> None:
    found = look_again(tuple(before), chance, looks=4)
    first = [found[0], *(b - a for a, b in pairwise(found))]
    assert first == sorted(first, reverse=True)
    then = look_again((*before, chance), chance, looks=3)
    assert found[3] == pytest.approx(1 - (1 - found[0]) * (1 - then[2]))
    assert miss_all(before) * (1 - found[0]) == pytest.approx(miss_all([*before, chance]))


def test_a_look_that_misses_nothing_leaves_nothing() -> None:
    assert miss_all([1.0]) == miss_all([0.3, 1.0]) == 0.0
    assert look_again((1.0,), 0.8, looks=2) == (0.0, 0.0)
    assert look_again((), 1.0, looks=1) == (1.0,)
