"""What a look costs, and which rooms come before another look."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_models.search.looks import leave_out, metres_of_look


def test_a_look_costs_more_in_a_larger_room_of_which_more_is_left() -> None:
    sizes = [metres_of_look(area) for area in (3.0, 6.0, 12.0, 24.0)]
    assert sizes == sorted(sizes)
    assert metres_of_look(None) == metres_of_look(12.0)
    assert metres_of_look(12.0, share=0.5) == pytest.approx(metres_of_look(12.0) / 2)
    assert metres_of_look(12.0, share=0.0) == 1.0


def named(
    likely: list[float], missed: list[float], *, here: int | None, left: list[int] | None = None
) -> list[int]:
    rooms = np.isin(np.arange(len(likely)), range(len(likely)) if left is None else left)
    again = np.arange(len(likely)) == (-1 if here is None else here)
    return np.flatnonzero(
        leave_out(rooms, np.array(missed), np.array(likely), again=again)
    ).tolist()


def test_a_room_in_which_a_look_missed_waits_for_others_that_are_half_as_likely() -> None:
    assert named([0.3, 0.1, 0.1], [0.2, 1, 1], here=0) == [1, 2]
    assert named([0.19, 0.02, 0.1], [0.2, 0.2, 1], here=1) == [2]
    assert named([0.21, 0.02, 0.1], [0.2, 0.2, 1], here=1) == [0, 2]
    assert named([0.3, 0.02, 0.02], [0.2, 0.2, 0.2], here=2) == [0, 1]
    assert named([0.3, 0.2, 0.01], [0.2, 1, 1], here=None) == [1, 2]


def test_the_room_of_the_last_look_comes_again_only_if_it_is_the_only_one() -> None:
    assert named([0.3, 0.0001], [0.2, 1], here=0) == [1]
    assert named([0.3, 0.1], [0.2, 1], here=0, left=[0]) == [0]


def test_a_glance_is_no_look() -> None:
    """With a chance of .3, a room may be looked into again if it is ten times likelier."""
    assert named([0.6, 0.02], [0.7, 1], here=0) == [0, 1]
    assert named([0.6, 0.2], [0.7, 1], here=0) == [1]


@given(st.lists(st.tuples(st.floats(0, 1), st.floats(0.001, 1)), min_size=1, max_size=6))
def test_some_room_is_left_as_long_as_one_is(rooms: list[tuple[float, float]]) -> None:
    likely, missed = (list(part) for part in zip(*rooms, strict=True))
    for here in range(len(rooms)):
        assert named(likely, missed, here=here)
