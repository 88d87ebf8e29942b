"""Moves that are priced by parts, against walks along the order and by hand."""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_models.search import orders
from bsg_models.search.order_moves import improve
from bsg_models.search.order_walks import improve_slowly
from bsg_models.search.orders import expected_cost, order_rooms
from bsg_models.search.shortest_paths import find_ways

Floats = npt.NDArray[np.float64]


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
