"""What a look costs, and what looks that are repeated miss."""

from __future__ import annotations

import math
from itertools import pairwise

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_models.search.looks import PIECE, ROOM, look_again, metres_of_look, miss_all

CHANCES = st.lists(st.floats(0, 0.99), max_size=5)


def test_a_look_costs_more_in_a_larger_room_of_which_more_is_left() -> None:
    sizes = [metres_of_look(area) for area in (3.0, 6.0, 12.0, 24.0)]
    assert sizes == sorted(sizes)
    assert metres_of_look(None) == metres_of_look(12.0)
    assert metres_of_look(12.0, share=0.5) == pytest.approx(metres_of_look(12.0) / 2)
    assert metres_of_look(12.0, share=0.0) == 1.0


@given(CHANCES, st.sampled_from([ROOM, PIECE]))
def test_a_share_of_the_places_is_overlooked_and_looks_are_independent_in_the_others(
    chances: list[float], overlooked: float
) -> None:
    """By drawing nothing: the mean over both kinds of places, each look alone being right."""
    missed = miss_all(chances, overlooked=overlooked)
    for chance in chances:
        assert miss_all([chance], overlooked=overlooked) == pytest.approx(1 - chance)
    assert missed == pytest.approx(miss_all(reversed(chances), overlooked=overlooked))
    surest = max(chances, default=0.0)
    assert min(overlooked, 1 - surest) - 1e-9 <= missed <= 1 - surest + 1e-9
    if surest < 1 - overlooked:
        others = math.prod((1 - c - overlooked) / (1 - overlooked) for c in chances)
        assert missed == pytest.approx(overlooked + (1 - overlooked) * others)


@given(CHANCES)
def test_looks_may_be_kept_as_one(chances: list[float]) -> None:
    for number in range(len(chances)):
        joined = 1 - miss_all(chances[:number])
        assert miss_all([joined, *chances[number:]]) == pytest.approx(miss_all(chances), abs=1e-9)


@given(CHANCES, st.floats(0.01, 0.99))
def test_a_further_look_finds_less_than_the_one_before_and_looks_follow_each_other(
    before: list[float], chance: float
) -> None:
    found = look_again(tuple(before), chance, looks=4)
    first = [found[0], *(b - a for a, b in pairwise(found))]
    assert all(b <= a + 1e-9 for a, b in pairwise(first))
    assert miss_all(before) * (1 - found[0]) == pytest.approx(miss_all([*before, chance]))
    then = look_again((*before, chance), chance, looks=3)
    assert 1 - found[3] == pytest.approx((1 - found[0]) * (1 - then[2]))


def test_a_look_that_misses_nothing_leaves_nothing() -> None:
    assert miss_all([1.0]) == miss_all([0.3, 1.0]) == 0.0
    assert miss_all([]) == 1.0
    assert look_again((1.0,), 0.8, looks=2) == (0.0, 0.0)
    assert look_again((), 1.0, looks=1) == (1.0,)
