"""Plans against all plans, all policies, and a sum over everything that may be where."""

from __future__ import annotations

import itertools
from collections.abc import Iterator
from functools import cache

import numpy as np
import pytest

from bsg_data.arrays import Floats, Ints
from bsg_models.search.knowledge import find_ways
from bsg_models.search.plans import plan_search, plan_tours, split_plan
from bsg_models.search.problem import Plans, SearchProblem, pose_search


def sample_problem(
    seed: int, *, looks: int = 5, things: int = 3, robots: int = 1, single: bool | None = None
) -> SearchProblem:
    """Return a search in which looks may share rooms, and the building may be tilted."""
    rng = np.random.default_rng(seed)
    looks, things = int(rng.integers(1, looks + 1)), int(rng.integers(1, things + 1))
    room = np.sort(rng.integers(0, looks, looks)) if rng.random() < 0.6 else np.arange(looks)
    at = rng.uniform(0, 15, (looks + robots, 2))
    legs = np.linalg.norm(at[:, None] - at[:looks], axis=2) + rng.uniform(0, 8, looks)
    finds = rng.random((looks, things)) ** 3
    for number in set(room.tolist()):
        finds[room == number] /= np.maximum(finds[room == number].sum(axis=0) / 0.9, 1)
    return SearchProblem(
        legs[None],
        finds[None].clip(1e-6),
        single=bool(rng.random() < 0.6) if single is None else single,
        delay=rng.uniform(0, 5, (1, robots)) * (robots > 1),
        room=room[None] if len(set(room.tolist())) < looks else None,
        scale=rng.uniform(0.7, 3, (1, things)) if rng.random() < 0.5 else None,
    )


def all_plans(problem: SearchProblem) -> Ints:
    """Return every plan, `[N, n + K − 1]`: the robots' numbers stand in their order."""
    looks, others = range(problem.looks), problem.robots - 1
    orders = list(itertools.permutations(looks))
    length = problem.looks + others
    every = []
    for places in itertools.combinations(range(length), others):
        rest = [place for place in range(length) if place not in places]
        some = np.empty((len(orders), length), dtype=np.int64)
        some[:, rest] = orders
        some[:, list(places)] = problem.looks + 1 + np.arange(others)
        every.append(some)
    return np.concatenate(every)


def expect_all(problem: SearchProblem, every: Ints) -> Floats:
    return Plans.of(problem.joint, copies=len(every)).expect(every.T)


def list_times(problem: SearchProblem, plan: Ints) -> Floats:
    """Return when each look ends, `[n]`."""
    times = np.zeros(problem.looks)
    for robot, looks in enumerate(split_plan(plan, problem)):
        place, clock = problem.looks + robot, problem.delay[0, robot]
        for look in looks:
            clock += problem.legs[0, place, look]
            times[look], place = clock, look
    return times


def list_finds(problem: SearchProblem, thing: int) -> Iterator[tuple[float, tuple[int, ...]]]:
    """Yield how likely it is that just some looks find a thing, and which."""
    looks, finds = range(problem.looks), problem.finds[0, :, thing]
    room = looks if problem.room is None else problem.room[0].tolist()
    scale = 1.0 if problem.scale is None else float(problem.scale[0, thing])
    choices = []
    for number in sorted(set(room)):
        own = [look for look in looks if room[look] == number]
        choices.append([(finds[look], (look,)) for look in own] + [(1 - finds[own].sum(), ())])
    some = [
        (float(np.prod([p for p, _ in parts])), tuple(look for _, own in parts for look in own))
        for parts in itertools.product(*choices)
    ]
    yield 1 - sum(p for p, which in some if which) / scale, ()
    yield from ((p / scale, which) for p, which in some if which)


def expect_naively(problem: SearchProblem, plan: Ints) -> float:
    """Return the mean time of the last look that is needed, over everything that may be where."""
    times, total, weight = list_times(problem, plan), 0.0, 0.0
    every = [list(list_finds(problem, thing)) for thing in range(problem.finds.shape[2])]
    for parts in itertools.product(*every):
        likely = float(np.prod([p for p, _ in parts]))
        ends = [times[list(which)] for _, which in parts if which]
        if problem.single and len(ends) < len(parts):
            continue  # given that each is found
        weight += likely
        first = [moments.min() if problem.single else moments.max() for moments in ends]
        total += likely * max(first, default=0.0)
    return total / weight


@pytest.mark.parametrize("robots", [1, 2, 3])
def test_the_expected_cost_is_the_mean_over_all_that_may_be(robots: int) -> None:
    for seed in range(25):
        problem = sample_problem(seed, looks=4, things=2, robots=robots)
        every = all_plans(problem)
        plan = every[seed * 7 % len(every)]
        found = problem.expect(plan[None])[0]
        assert found == pytest.approx(expect_naively(problem, plan), rel=1e-6, abs=1e-9)


def test_the_exact_plan_is_the_best_of_all_orders() -> None:
    """Of one thing, and of several if all are looked for: then it does not matter which."""
    for seed in range(60):
        problem = sample_problem(seed, single=bool(seed % 2), things=1 if seed % 2 else 3)
        plan, every = plan_search(problem), all_plans(problem)
        assert sorted(plan[0].tolist()) == list(range(problem.looks))
        best = expect_all(problem, every).min()
        assert problem.expect(plan)[0] == pytest.approx(best, rel=1e-6, abs=1e-9)


def first_costs(problem: SearchProblem) -> Floats:
    """Return what the best policy costs that begins with each look, for one of each thing, `[n]`.

    A policy goes on as it likes, once it knows which things are found.
    """
    looks, things = problem.finds.shape[1:]
    full, legs = frozenset(range(looks)), problem.legs[0]
    room = list(range(looks)) if problem.room is None else problem.room[0].tolist()

    @cache
    def left(seen: frozenset[int], thing: int) -> float:
        """P(it is still to be found), given that the plan finds it."""
        share = [
            np.prod(
                [
                    1 - sum(problem.finds[0, i, thing] for i in some if room[i] == one)
                    for one in set(room)
                ]
            )
            for some in (seen, full)
        ]
        return float((share[0] - share[1]) / (1 - share[1]))

    @cache
    def go_on(seen: frozenset[int], place: int, goal: frozenset[int]) -> float:
        return min((step(seen, place, goal, one) for one in full - seen), default=0.0)

    def step(seen: frozenset[int], place: int, goal: frozenset[int], look: int) -> float:
        cost, then = float(legs[place, look]), seen | {look}
        misses = {one: left(then, one) / left(seen, one) for one in goal}
        for number in range(1, len(goal) + 1):
            for rest in itertools.combinations(sorted(goal), number):
                likely = np.prod([misses[a] if a in rest else 1 - misses[a] for a in goal])
                if likely > 0:
                    cost += float(likely) * go_on(then, look, frozenset(rest))
        return cost

    goal = frozenset(range(things))
    return np.array([step(frozenset(), looks, goal, look) for look in range(looks)])


def test_a_plan_for_several_things_begins_as_the_best_policy() -> None:
    """It depends on which are found by then."""
    for seed in range(40):
        problem = sample_problem(seed, looks=4, single=True)
        costs = first_costs(problem)
        assert costs[plan_search(problem)[0, 0]] == pytest.approx(costs.min(), rel=1e-6)


@pytest.mark.parametrize(("robots", "looks"), [(1, 5), (2, 5), (3, 4)])
@pytest.mark.parametrize("budget", [None, 15.0])
def test_plans_that_are_not_exact_are_nearly_the_best_of_all(
    robots: int, looks: int, budget: float | None
) -> None:
    """Of few looks; of two things, too. Within a budget, what is found counts first."""
    excess = []
    for seed in range(25):
        sample = sample_problem(seed, looks=looks, things=2, robots=robots)
        problem = SearchProblem(**{**vars(sample), "budget": budget})
        best = expect_all(problem, all_plans(problem)).min()
        found = problem.expect(plan_search(problem, exact=0))[0]
        excess.append(found / max(best, 1e-9) - 1)
    assert min(excess) > -1e-6
    assert max(excess) < 0.01


def sample_searches(searches: int, rooms: int, things: int, *, single: bool) -> SearchProblem:
    """Return searches of which the ways back may cost something else."""
    rng = np.random.default_rng(rooms)
    costs = find_ways(rng.uniform(1, 10, (searches, rooms + 1, rooms + 1))).costs
    finds = rng.beta(0.3, 1.5, (searches, rooms, things)).clip(1e-6, 1)
    return SearchProblem(costs[:, :, :rooms], finds, single, np.zeros((searches, 1)))


@pytest.mark.parametrize(
    ("single", "things", "excess"), [(True, 1, 0.003), (True, 3, 0.03), (False, 1, 0.01)]
)
def test_the_plan_of_many_looks_is_nearly_exact(single: bool, things: int, excess: float) -> None:
    problem = sample_searches(60, 10, things, single=single)
    best, found = (problem.expect(plan_search(problem, exact=exact)) for exact in (10, 0))
    assert (found / best - 1).mean() < excess


@pytest.mark.parametrize(("rooms", "robots"), [(4, 1), (9, 1), (14, 1), (60, 1), (9, 2)])
@pytest.mark.parametrize("single", [True, False])
def test_of_rooms_that_are_alike_the_first_is_named(rooms: int, robots: int, single: bool) -> None:
    """A hotel; the last room is likelier."""
    ways = np.full((1, rooms + robots, rooms), 3.1)
    finds = np.full((1, 1, rooms, 1), 0.0137)
    finds[..., -1, :] = 0.7
    problem, _ = pose_search(ways, finds, look=1.7, single=single)
    named = [look for look in plan_search(problem)[0].tolist() if look < rooms - 1]
    assert named == sorted(named)


def walk_through(costs: Floats, here: int, rooms: tuple[int, ...]) -> float:
    return float(sum(costs[a, b] for a, b in itertools.pairwise((here, *rooms))))


def test_a_tour_is_the_shortest_of_all() -> None:
    """Node 0 and one more are no rooms."""
    for seed in range(20):
        rng = np.random.default_rng(seed)
        rooms = int(rng.integers(1, 6))
        costs = find_ways(rng.uniform(1, 10, (1, rooms + 2, rooms + 2))).costs
        here, holds = int(rng.integers(rooms + 2)), np.zeros((1, rooms + 2), dtype=bool)
        holds[0, 1 : rooms + 1] = True
        places = plan_tours(costs, np.array([here]), holds)[0]
        assert places[[0, rooms + 1]].tolist() == [rooms + 2] * 2
        assert sorted(places[1:-1].tolist()) == list(range(rooms))
        tour = tuple((1 + np.argsort(places[1:-1])).tolist())
        every = itertools.permutations(range(1, rooms + 1))
        best = min(walk_through(costs[0], here, other) for other in every)
        assert walk_through(costs[0], here, tour) == pytest.approx(best)


@pytest.mark.parametrize("single", [True, False])
@pytest.mark.parametrize("number", [8, 12])
@pytest.mark.parametrize("robots", [1, 2])
def test_certain_and_impossible_rooms_are_no_trouble(
    number: int, robots: int, single: bool
) -> None:
    sample = sample_searches(1, number, 1, single=single)
    legs = np.concatenate([sample.legs, sample.legs[:, : robots - 1]], axis=1)
    finds = np.zeros((1, number, 1))
    for likely in (1.0, 0.0):
        finds[0, 7] = likely
        problem = SearchProblem(legs, finds, single, np.zeros((1, robots)))
        plan = plan_search(problem)
        assert sorted({*range(number)} - {*plan[0].tolist()}) == []
        first = min(float(legs[0, number + robot, 7]) for robot in range(robots))
        assert problem.expect(plan)[0] == pytest.approx(first * likely)
