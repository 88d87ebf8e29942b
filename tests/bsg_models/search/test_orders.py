"""Orders of rooms against all orders, and against a naive sum."""

from __future__ import annotations

import itertools

import numpy as np
import numpy.typing as npt
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_models.search import orders
from bsg_models.search.orders import (
    choose_cover,
    choose_rooms,
    expected_cost,
    order_rooms,
    plan_tours,
)
from bsg_models.search.shortest_paths import find_ways

Floats = npt.NDArray[np.float64]


def sample_case(seed: int, rooms: int, classes: int) -> tuple[Floats, Floats]:
    rng = np.random.default_rng(seed)
    edges = rng.uniform(1, 10, (1, rooms + 1, rooms + 1))
    return find_ways(edges).costs[0], 1 - rng.beta(0.3, 1.5, (rooms, classes)).clip(1e-6, 1)


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
            found = ~left.any(axis=0) if not single else (left.any(axis=0) < holds.any(axis=0))
            done = not left.any() if not single else bool((found | ~holds.any(axis=0)).all())
            if done:
                break
            cost += costs[place, room]
            place = room
            if single:
                hit = left[room].copy()
                left[:, hit] = False
            else:
                left[room] = False
        total += probability * cost
    return total / weight if single else total


@given(seed=st.integers(0, 2**32), rooms=st.integers(1, 4), single=st.booleans())
@settings(max_examples=25, deadline=None)
def test_the_expected_cost_is_the_mean_over_all_that_may_be(
    seed: int, rooms: int, single: bool
) -> None:
    costs, miss = sample_case(seed, rooms, 2 if single else 1)
    order = tuple(np.random.default_rng(seed).permutation(rooms).tolist())
    found = expected_cost(costs, rooms, miss, np.array(order), single=single)
    assert found == pytest.approx(naive(costs, miss, order, single=single), rel=1e-6)


@given(
    seed=st.integers(0, 2**32),
    rooms=st.integers(1, 7),
    classes=st.integers(1, 2),
    single=st.booleans(),
)
@settings(max_examples=30, deadline=None)
def test_the_exact_order_is_the_best_of_all(
    seed: int, rooms: int, classes: int, single: bool
) -> None:
    costs, miss = sample_case(seed, rooms, classes if single else 1)
    order = order_rooms(costs, rooms, miss, single=single)
    assert sorted(order.tolist()) == list(range(rooms))
    best = min(
        expected_cost(costs, rooms, miss, np.array(other), single=single)
        for other in itertools.permutations(range(rooms))
    )
    assert expected_cost(costs, rooms, miss, order, single=single) == pytest.approx(best)


def walk_through(costs: Floats, here: int, rooms: tuple[int, ...]) -> float:
    return float(sum(costs[a, b] for a, b in itertools.pairwise((here, *rooms))))


@given(
    seed=st.integers(0, 2**32), rooms=st.integers(1, 5), kicks=st.sampled_from([(9, 0), (0, 40)])
)
@settings(max_examples=20, deadline=None)
def test_a_tour_is_the_shortest_of_all(seed: int, rooms: int, kicks: tuple[int, int]) -> None:
    """Exactly, and by improving orders that were disturbed; node 0 and one more are no rooms."""
    costs, _ = sample_case(seed, rooms + 1, 1)
    rng = np.random.default_rng(seed)
    here, holds = int(rng.integers(rooms + 2)), np.zeros((1, rooms + 2), dtype=bool)
    holds[0, 1 : rooms + 1] = True
    exact, times = kicks
    places = plan_tours(costs[None], np.array([here]), holds, exact=exact, kicks=times)[0]
    assert places[[0, rooms + 1]].tolist() == [rooms + 2] * 2
    assert sorted(places[1:-1].tolist()) == list(range(rooms))
    tour = tuple(np.argsort(places)[:rooms].tolist())
    every = itertools.permutations(range(1, rooms + 1))
    best = min(walk_through(costs, here, other) for other in every)
    assert walk_through(costs, here, tour) == pytest.approx(best)


@given(seed=st.integers(0, 2**32), rooms=st.integers(1, 5), classes=st.integers(1, 3))
@settings(max_examples=30, deadline=None)
def test_the_way_past_each_class_is_the_cheapest(seed: int, rooms: int, classes: int) -> None:
    """Of two searches at once; in the second the last class is found already."""
    costs, _ = sample_case(seed, rooms, 1)
    rng = np.random.default_rng(seed)
    holds = rng.random((2, rooms + 1, classes)) < 0.4
    holds[:, rooms] = False  # where the robot is
    holds[:, rng.integers(rooms)] = True
    wanted = np.ones((2, classes), dtype=bool)
    wanted[1, -1] = classes == 1
    found = choose_cover(np.stack([costs, costs]), np.array([rooms, rooms]), holds, wanted=wanted)
    for e in range(2):
        ways = [
            (walk_through(costs, rooms, way), way[0])
            for number in range(1, rooms + 1)
            for way in itertools.permutations(range(rooms), number)
            if holds[e, list(way)].any(axis=0)[wanted[e]].all()
        ]
        begun_so = min(cost for cost, first in ways if first == found[e])
        assert begun_so == pytest.approx(min(ways)[0])  # ways through a room and to it cost alike


def test_nowhere_to_go_past_a_class_that_is_nowhere() -> None:
    costs, _ = sample_case(0, 3, 1)
    nowhere = np.zeros((1, 4, 1), dtype=bool)
    wanted = np.ones((1, 1), dtype=bool)
    assert choose_cover(costs[None], np.array([3]), nowhere, wanted=wanted).tolist() == [-1]


@pytest.mark.parametrize("single", [True, False])
def test_the_search_for_orders_of_many_rooms_is_nearly_exact(single: bool) -> None:
    found, best = [], []
    for seed in range(60):
        costs, miss = sample_case(seed, 10, 1)
        for exact, values in ((10, best), (0, found)):
            order = order_rooms(costs, 10, miss, single=single, exact=exact)
            values.append(expected_cost(costs, 10, miss, order, single=single))
    excess = np.array(found) / np.array(best) - 1
    assert excess.min() > -1e-9
    assert excess.mean() < 0.005


def test_of_two_classes_the_rare_one_decides_where_to_go_by_hand() -> None:
    """Either room may hold the first class, and only the far one is likely to hold the second."""
    costs = np.array([[0.0, 3.0, 0.0], [3.0, 0.0, 0.0], [1.0, 2.0, 0.0]])  # 1 to the left, 2 right
    miss = np.array([[0.5, 0.99], [0.5, 0.01]])
    # Far first: 2 + 3 · (1 − (1 − 1/3) (1 − 0.0001)) = 3.0002; near first: 3.98.
    # Of the first class alone, near first is better: 1 + 3 · 1/3 = 2 and not 2 + 3 · 1/3 = 3.
    for exact in (2, 1):
        order = order_rooms(costs, 2, miss, single=True, exact=exact)
        assert order.tolist() == [1, 0]
    assert order_rooms(costs, 2, miss[:, :1], single=True, exact=1).tolist() == [0, 1]


@pytest.mark.parametrize("classes", [1, 2])
def test_an_order_that_is_improved_is_nearly_the_best(classes: int) -> None:
    """Of five rooms two classes are priced by parts, which four terms make."""
    for seed in range(10):
        costs, miss = sample_case(seed, 5, classes)
        found, best = (
            expected_cost(costs, 5, miss, order, single=True)
            for order in (order_rooms(costs, 5, miss, single=True, exact=exact) for exact in (1, 5))
        )
        assert best <= found * (1 + 1e-9) <= 1.1 * best


def test_orders_are_disturbed_by_the_numbers_of_the_standard_of_c() -> None:
    """Its example of `rand` begins with 16838, 5758, 10113, 17515, 31051, 5627, 23010."""
    order = np.arange(10)
    disturbed, state = orders._disturb(order, 1)
    # Place 8 is exchanged with 8, then 3 with 5, then 1 with 7.
    assert disturbed.tolist() == [0, 7, 2, 5, 4, 3, 6, 1, 8, 9]
    assert order.tolist() == list(range(10))
    assert state // 65536 == 5627
    again, _ = orders._disturb(np.arange(100_000), state)
    assert again[23010] != 23010


@pytest.mark.parametrize("single", [True, False])
def test_certain_and_impossible_rooms_are_no_trouble(single: bool) -> None:
    costs, _ = sample_case(0, 12, 1)
    presence = np.zeros((1, 13, 1))
    presence[0, 7] = 1.0
    rooms = np.ones((1, 13), dtype=bool)
    rooms[0, 12] = False
    where = (costs[None], np.array([12]), rooms)
    wanted = np.ones((1, 1), dtype=bool)
    for exact in (12, 2):
        chosen = choose_rooms(*where, presence, wanted=wanted, single=single, exact=exact)
        assert costs[12, chosen[0]] + costs[chosen[0], 7] == pytest.approx(costs[12, 7])
    nowhere = choose_rooms(*where, 0 * presence, wanted=wanted, single=single)
    assert rooms[0, nowhere[0]]
    none_left = choose_rooms(*where[:2], 0 * rooms > 0, presence, wanted=wanted, single=single)
    assert none_left.tolist() == [-1]
