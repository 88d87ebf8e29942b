"""Moves that are priced by parts, against walks along the order and by hand."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_models.search import orders
from bsg_models.search.order_moves import (
    _expand,
    _find_move,
    _move,
    _sum_terms,
    improve,
)
from bsg_models.search.order_walks import LONGEST, improve_slowly, sum_legs
from bsg_models.search.orders import expected_cost, order_rooms
from bsg_models.search.shortest_paths import find_ways

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]


def sample_case(seed: int, rooms: int, classes: int) -> tuple[Floats, Floats]:
    """Return costs of which those back may differ, and q of some classes."""
    rng = np.random.default_rng(seed)
    edges = rng.uniform(1, 10, (1, rooms + 1, rooms + 1))
    return find_ways(edges).costs[0], 1 - rng.beta(0.3, 1.5, (rooms, classes)).clip(1e-3, 1)


def test_two_rooms_by_hand() -> None:
    """The far room, which likely holds all there is, comes first."""
    ways = np.array([[0.0, 3.0, 0.0], [3.0, 0.0, 0.0], [1.0, 2.0, 0.0]])  # 1 to the left, 2 right
    miss, order = np.array([[0.9], [0.1]]), np.array([0, 1])
    # Near first: 1 · (1 − 0.9 · 0.1) + 3 · (1 − 0.1) = 3.61.
    assert expected_cost(ways, 2, miss, order, single=False) == pytest.approx(3.61)
    # Far first: 2 · (1 − 0.9 · 0.1) + 3 · (1 − 0.9) = 2.12.
    assert improve(ways, miss, False, order) == pytest.approx(2.12)
    assert order.tolist() == [1, 0]


@given(
    seed=st.integers(0, 2**32),
    rooms=st.integers(2, 14),
    classes=st.integers(1, 3),
    single=st.booleans(),
)
@settings(max_examples=60, deadline=None)
def test_parts_price_every_move_as_a_walk_does(
    seed: int, rooms: int, classes: int, single: bool
) -> None:
    """The same moves are found to help, one after the other, and so the same order is found."""
    ways, miss = sample_case(seed, rooms, classes if single else 1)
    by_parts = np.random.default_rng(seed).permutation(rooms)
    by_walks = by_parts.copy()
    cost = improve(ways, miss, single, by_parts)
    assert cost == pytest.approx(improve_slowly(ways, miss, single, by_walks), rel=1e-9)
    assert cost == pytest.approx(expected_cost(ways, rooms, miss, by_parts, single=single))
    assert by_parts.tolist() == by_walks.tolist()


Move = tuple[int, int, int]  # length of the part, 0 to turn it; from where; to where


def find_by_parts(ways: Floats, miss: Floats, single: bool, order: Ints) -> set[Move]:
    """Return the moves that are priced as helpful."""
    n = len(order)
    weights, factors = _expand(miss, single)
    around, legs = np.ones((n + 1, len(weights))), np.zeros(n + 1)
    sum_legs(ways, miss, single, order, np.ones((n + 1, miss.shape[1])), legs)
    _sum_terms(factors, single, order, around)
    known, found = (ways, weights, factors, order, around, legs, single), set()
    for length in range(min(LONGEST, n - 1) + 1):
        for i in range(n - max(length, 1) + 1):
            j, low, high = _find_move(known, length, i, 0)
            while j < n:
                found.add((length, i, j))
                assert (low, high) == (min(i, j), max(i, j) + max(length, 1) - 1)
                j, low, high = _find_move(known, length, i, j + 1)
    return found


def gain_by_walks(ways: Floats, miss: Floats, single: bool, order: Ints) -> dict[Move, float]:
    """Return which share of the order's cost each move saves."""
    n = len(order)
    before, gains = expected_cost(ways, n, miss, order, single=single), {}
    for length in range(min(LONGEST, n - 1) + 1):
        for i in range(n - max(length, 1) + 1):
            for j in range(i + 1 if length == 0 else 0, n - max(length, 1) + 1):
                if i == j:
                    continue
                trial = order.copy()
                _move(order, trial, length, i, j)
                cost = expected_cost(ways, n, miss, trial, single=single)
                gains[length, i, j] = 1 - cost / before
    return gains


@given(
    seed=st.integers(0, 2**32),
    rooms=st.integers(2, 9),
    classes=st.integers(1, 3),
    single=st.booleans(),
)
@settings(max_examples=40, deadline=None)
def test_a_move_is_found_if_and_only_if_it_helps(
    seed: int, rooms: int, classes: int, single: bool
) -> None:
    ways, _ = sample_case(seed, rooms, 1)
    rng = np.random.default_rng(seed)
    miss = rng.uniform(0.1, 0.95, (rooms, classes if single else 1))
    order = rng.permutation(rooms)
    found, gains = (find(ways, miss, single, order) for find in (find_by_parts, gain_by_walks))
    assert found <= {move for move, gain in gains.items() if gain > 0.5e-9}  # 1e-9 is asked for
    assert found >= {move for move, gain in gains.items() if gain > 2e-9}


def test_orders_to_start_from_by_hand() -> None:
    """Room 0 is near, room 1 likeliest, and room 2 has the most chance for what it costs."""
    ways = np.array([[0, 9, 2, 0], [9, 0, 8, 0], [2, 8, 0, 0], [1, 10, 1.5, 0]], dtype=float)
    miss = np.array([[0.95, 1.0], [0.1, 0.9], [0.9, 0.5]])
    assert orders._begin(ways, miss, 0).tolist() == [0, 2, 1]
    assert orders._begin(ways, miss, 1).tolist() == [1, 2, 0]
    assert orders._begin(ways, miss, 2).tolist() == [2, 1, 0]


@pytest.mark.parametrize(("single", "classes"), [(True, 1), (True, 3), (False, 1)])
def test_many_rooms_are_ordered_as_well_as_by_walks(single: bool, classes: int) -> None:
    for seed in range(3):
        ways, miss = sample_case(seed, 40, classes)
        found = expected_cost(
            ways, 40, miss, order_rooms(ways, 40, miss, single=single), single=single
        )
        for start in range(3):
            order = orders._begin(ways, miss, start)
            slow = improve_slowly(ways, miss, single, order)
            assert found <= slow * (1 + 1e-9)


def test_classes_that_are_hardly_anywhere_are_ordered_by_walks() -> None:
    """Two sums that nearly cancel would say nothing, and the order has to be good all the same."""
    ways, _ = sample_case(0, 12, 1)
    miss = 1 - np.random.default_rng(0).uniform(1e-6, 3e-6, (12, 3))
    assert not orders._composes(miss, True)
    order = order_rooms(ways, 12, miss, single=True)
    found = expected_cost(ways, 12, miss, order, single=True)
    exact = order_rooms(ways, 12, miss, single=True, exact=12)
    best = expected_cost(ways, 12, miss, exact, single=True)
    assert best <= found * (1 + 1e-9) <= 1.1 * best
