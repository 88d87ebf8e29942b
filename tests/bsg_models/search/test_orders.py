"""Orders of rooms against all orders, and against a naive sum."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.arrays import Floats
from bsg_models.search import orders
from bsg_models.search.knowledge import find_ways
from bsg_models.search.orders import (
    choose_rooms,
    expected_costs,
    order_rooms,
    plan_tours,
)


def sample_case(seed: int, rooms: int, classes: int) -> tuple[Floats, Floats]:
    """Return costs of which those back may differ, and q of some classes."""
    rng = np.random.default_rng(seed)
    edges = rng.uniform(1, 10, (1, rooms + 1, rooms + 1))
    return find_ways(edges).costs[0], 1 - rng.beta(0.3, 1.5, (rooms, classes)).clip(1e-6, 1)


def expect_one(ways: Floats, miss: Floats, order: object, *, single: bool) -> float:
    return float(expected_costs(ways[None], miss[None], np.array([order]), single=single)[0])


def naive(costs: Floats, miss: Floats, order: tuple[int, ...], *, single: bool) -> float:
    """Return the expected cost by summing over everything that may be where."""
    rooms, classes = miss.shape
    total = weight = 0.0
    for there in itertools.product([False, True], repeat=rooms * classes):
        holds = np.array(there).reshape(rooms, classes)
        if single and not holds.any(axis=0).all():
            continue  # it is known that each class is somewhere
        probability = float(np.where(holds, 1 - miss, miss).prod())
        weight += probability
        left, place, cost = holds.copy(), rooms, 0.0
        for room in order:
            if not left.any():
                break
            cost += costs[place, room]
            place = room
            if single:
                left[:, left[room]] = False
            else:
                left[room] = False
        total += probability * cost
    return total / weight if single else total


@given(
    seed=st.integers(0, 2**32),
    rooms=st.integers(1, 4),
    classes=st.integers(1, 2),
    single=st.booleans(),
)
@settings(max_examples=25, deadline=None)
def test_the_expected_cost_is_the_mean_over_all_that_may_be(
    seed: int, rooms: int, classes: int, single: bool
) -> None:
    costs, miss = sample_case(seed, rooms, classes)
    order = tuple(np.random.default_rng(seed).permutation(rooms).tolist())
    found = expect_one(costs, miss, order, single=single)
    assert found == pytest.approx(naive(costs, miss, order, single=single), rel=1e-6)


@given(
    seed=st.integers(0, 2**32),
    rooms=st.integers(1, 6),
    classes=st.integers(1, 2),
    single=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_the_exact_order_is_the_best_of_all(
    seed: int, rooms: int, classes: int, single: bool
) -> None:
    """Of two searches at once."""
    cases = [sample_case(seed + more, rooms, classes) for more in range(2)]
    ways, miss = (np.stack(parts) for parts in zip(*cases, strict=True))
    chosen = order_rooms(ways, miss, single=single)
    found = expected_costs(ways, miss, chosen, single=single)
    for one, order, cost in zip(cases, chosen, found, strict=True):
        assert sorted(order.tolist()) == list(range(rooms))
        every = itertools.permutations(range(rooms))
        assert cost == pytest.approx(min(expect_one(*one, other, single=single) for other in every))


@pytest.mark.parametrize(
    ("single", "classes", "most"), [(True, 1, 0.003), (True, 3, 0.03), (False, 1, 0.01)]
)
def test_the_order_of_many_rooms_is_nearly_exact(single: bool, classes: int, most: float) -> None:
    """Rooms that are inserted one by one come near the order that is exact."""
    cases = [sample_case(seed, 10, classes) for seed in range(60)]
    ways, miss = (np.stack(parts) for parts in zip(*cases, strict=True))
    best, found = (
        expected_costs(ways, miss, order_rooms(ways, miss, single=single, exact=e), single=single)
        for e in (10, 0)
    )
    excess = found / best - 1
    assert excess.min() > -1e-9
    assert excess.mean() < most


@pytest.mark.parametrize("single", [True, False])
def test_beyond_a_number_of_rooms_one_order_is_nearly_the_best(
    single: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    cases = [sample_case(seed, 30, 1) for seed in range(20)]
    ways, miss = (np.stack(parts) for parts in zip(*cases, strict=True))
    best = expected_costs(ways, miss, order_rooms(ways, miss, single=single), single=single)
    monkeypatch.setattr(orders, "_SEVERAL", 10)
    found = order_rooms(ways, miss, single=single)
    excess = expected_costs(ways, miss, found, single=single) / best - 1
    assert (np.sort(found, axis=1) == np.arange(30)).all()
    assert excess.mean() < 0.02


def walk_through(costs: Floats, here: int, rooms: tuple[int, ...]) -> float:
    return float(sum(costs[a, b] for a, b in itertools.pairwise((here, *rooms))))


@given(seed=st.integers(0, 2**32), rooms=st.integers(1, 5))
@settings(max_examples=20, deadline=None)
def test_a_tour_is_the_shortest_of_all(seed: int, rooms: int) -> None:
    """Node 0 and one more are no rooms."""
    costs, _ = sample_case(seed, rooms + 1, 1)
    rng = np.random.default_rng(seed)
    here, holds = int(rng.integers(rooms + 2)), np.zeros((1, rooms + 2), dtype=bool)
    holds[0, 1 : rooms + 1] = True
    places = plan_tours(costs[None], np.array([here]), holds)[0]
    assert places[[0, rooms + 1]].tolist() == [rooms + 2] * 2
    assert sorted(places[1:-1].tolist()) == list(range(rooms))
    tour = tuple((1 + np.argsort(places[1:-1])).tolist())
    every = itertools.permutations(range(1, rooms + 1))
    best = min(walk_through(costs, here, other) for other in every)
    assert walk_through(costs, here, tour) == pytest.approx(best)


@pytest.mark.parametrize("single", [True, False])
@pytest.mark.parametrize("number", [8, 12])
def test_certain_and_impossible_rooms_are_no_trouble(number: int, single: bool) -> None:
    costs, _ = sample_case(0, number, 1)
    presence = np.zeros((1, number + 1, 1))
    presence[0, 7] = 1.0
    rooms = np.arange(number + 1)[None] < number
    where, wanted = (costs[None], np.array([number])), np.ones((1, 1), dtype=bool)
    chosen = choose_rooms(*where, rooms, presence, wanted=wanted, single=single)
    assert costs[number, chosen[0]] + costs[chosen[0], 7] == pytest.approx(costs[number, 7])
    nowhere = choose_rooms(*where, rooms, 0 * presence, wanted=wanted, single=single)
    assert rooms[0, nowhere[0]]
    none_left = choose_rooms(*where, ~rooms & rooms, presence, wanted=wanted, single=single)
    assert none_left.tolist() == [-1]
