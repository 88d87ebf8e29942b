r"""Plan a search: the order of looks that costs least in expectation.

Up to `EXACT` looks of one robot, dynamic programming over sets of looks (Held and Karp 1962) finds
the best order. Of up to `JOINT` things, it also knows that the rest of a plan depends on which of
them are found by then: with L the share of a thing that a set of looks V leaves to the plan, and D
what one more look v takes of it,

    W(V, G) = min_v  d · Π_G L  +  Σ_{H ⊆ G} W(V + v, H) · Π_{G \ H} D

is what is left to pay after V, if the things G are not found.

Else looks are put into a plan one by one, where they cost least; then each is taken out and put in
again until nothing improves. The best of several such plans counts. They begin with the likeliest
look, the nearest, the likeliest for what it costs, or at random. Where that is enough, only the
best of these plans are improved: of one robot with few second looks, of several for one of each
thing, and of many looks. Looks that are alike are named in the order of their numbers.

Passing through a room on the way to another explores it in the paper's worlds. Such a plan costs
the same as one that names the room, so plans by the cheapest ways between rooms miss nothing.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from functools import lru_cache, partial
from itertools import combinations
from typing import NamedTuple

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.search.problem import (
    EXACT,
    LEAST,
    MORE_LOOKS,
    Plans,
    SearchProblem,
    put,
    share_rooms,
)

JOINT = 3  # things of which it matters which are found; each further one triples the time
CHANCES = 5  # plans that begin at random; more are better and take longer
_EXACT_TOUR, _TOUR_CHANCES = 12, 60  # a tour is planned once in a search
_CELLS = 1 << 19  # of tables; more searches are planned in turns
_NEVER = 1e30  # cost of a set that no plan comes to
_ROUNDING = 1e-9  # a smaller cost, or relative improvement, is none
_NEARLY, _TRIED = 0.005, 16  # P(found within a budget) that is as good; sets that are tried
_THOROUGH = 40  # looks, all of which are tried again, one after another
_IMPROVED, _LEAST_OF_MANY = 3, 3e-3  # plans that are improved if that is enough, and how far
_SHARED = 0.5  # of looks have a room in common: rooms are searched piece by piece
_SEVERAL = 100  # looks; of more, only the plan that costs least at first is improved
_LOOKS, _TEAM_LOOKS = 500, 100  # of all plans that begin at random, so that many have fewer


def plan_search(
    problem: SearchProblem, *, exact: int | None = None, chances: int = CHANCES
) -> Ints:
    """Return a best plan of each of S searches, `[S, n + K − 1]`.

    Args:
        problem: what is planned.
        exact: largest number of looks that is ordered exactly; None for `EXACT`, and `MORE_LOOKS`.
        chances: number of further plans that begin at random, for more looks.
    """
    problem = problem.joint
    if exact is None:
        exact = EXACT + MORE_LOOKS * (problem.room is not None)
    searches, looks = problem.finds.shape[:2]
    if looks <= exact and problem.robots == 1:
        timed = problem.budget is not None
        cells, plan = looks << looks, _plan_in_time if timed else _plan_exactly
    else:
        cells, plan = (3 + chances) * looks**2, partial(_plan_locally, chances=chances)
    together = max(1, _CELLS // max(1, cells))
    parts = [slice(i, i + together) for i in range(0, searches, together)]
    return _sort_alike(problem, np.concatenate([plan(problem.take(part)) for part in parts]))


def _sort_alike(problem: SearchProblem, plans: Ints) -> Ints:
    """Return plans that cost no more, and name the lowest number first of looks that are alike."""
    looks, legs = problem.looks, np.minimum(problem.legs, 1 / _ROUNDING)
    alike = np.full((len(plans), looks + problem.robots), np.inf)
    alike[:, :looks] = legs.sum(axis=1) + legs.max() * (problem.finds.sum(axis=2) + legs[:, looks])
    alike[:, :looks] = (alike[:, :looks] / (alike[:, :looks].max() + _ROUNDING)).round(12)
    numbers = np.delete(alike.argsort(axis=1, kind="stable"), looks, axis=1)
    places = np.take_along_axis(alike, plans, 1).argsort(axis=1, kind="stable")
    other = np.empty_like(plans)
    np.put_along_axis(other, places, numbers, 1)
    if (other == plans).all():
        return plans
    least, costs = problem.expect(plans), problem.expect(other)
    return np.where((costs <= least * (1 + _ROUNDING))[:, None], other, plans)


def split_plan(plan: Ints, problem: SearchProblem) -> list[list[int]]:
    """Return the looks of each robot, in their order, of a plan `[n + K − 1]`."""
    parts = [list[int]()]
    for number in plan.tolist():
        if number > problem.looks:
            parts.append([])
        else:
            parts[-1].append(number)
    return parts


def plan_tours(costs: Floats, here: Ints, holds: Bools) -> Ints:
    """Return the position of each room in a shortest way through some rooms, `[E, N]`.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N]` rooms to be visited; other rooms come last.
    """
    places = np.full(holds.shape, holds.shape[1])
    for some, which in by_number(holds):
        ways = take_ways(costs, here[some], some, which)
        finds = np.full((len(some), which.shape[1], 1), 1 - LEAST)
        problem = SearchProblem(ways, finds, single=False, delay=np.zeros((len(some), 1)))
        order = plan_search(problem, exact=_EXACT_TOUR, chances=_TOUR_CHANCES)
        rooms = np.take_along_axis(which, order, axis=1)
        places[some[:, None], rooms] = np.arange(which.shape[1])
    return places


def by_number(rooms: Bools) -> Iterator[tuple[Ints, Ints]]:
    """Yield the searches `[B]` that have equally many rooms, and these `[B, n]`."""
    numbers = rooms.sum(axis=1)
    for number in np.unique(numbers[numbers > 0]).tolist():
        some = np.flatnonzero(numbers == number)
        yield some, np.nonzero(rooms[some])[1].reshape(-1, number)


def take_ways(costs: Floats, here: Ints, rows: Ints, rooms: Ints) -> Floats:
    """Return the costs between rooms `[B, n]` of some searches, and from their robots' nodes."""
    nodes = np.concatenate([rooms, here[:, None]], axis=1)
    return np.asarray(costs[rows[:, None, None], nodes[:, :, None], rooms[:, None]])


# Exactly

_Goal = tuple[int, ...]  # things that are not found yet


def _plan_exactly(problem: SearchProblem) -> Ints:
    """Return the best order, from the least cost that remains after a set, in its last place."""
    looks, ways = problem.looks, problem.legs.transpose(1, 2, 0)  # searches last: contiguous
    left = _share_left(problem)
    goals = _list_goals(left.shape[2])
    weights = {goal: _multiply(left, goal) for goal in goals}
    never = np.full((1 << looks, looks, ways.shape[2]), _NEVER)
    never[-1] = 0.0
    remaining = {goal: never.copy() for goal in goals}
    for sets, inside, outside in _layers(looks, problem.in_turn):
        after = sets[:, None] | 1 << outside
        paid = {goal: costs[after, outside] for goal, costs in remaining.items()}
        for goal in goals:
            legs = ways[inside[:, :, None], outside[:, None]] * weights[goal][sets][:, None, None]
            legs += _go_on(goal, paid, left[sets][:, None], left[after])[:, None]
            remaining[goal][sets[:, None], inside] = legs.min(axis=2)
    every, each = np.arange(ways.shape[2]), np.arange(looks)[:, None]
    order = np.empty((looks, len(every)), dtype=np.int64)
    done, legs = np.zeros(len(every), dtype=np.int64), ways[looks, :looks]
    for place in range(looks):  # on the best way, as long as nothing is found
        after = done | 1 << each
        paid = {goal: costs[after, each, every] for goal, costs in remaining.items()}
        total = legs * weights[goals[-1]][done, every]
        total = total + _go_on(goals[-1], paid, left[done, every], left[after, every])
        order[place] = np.where(done >> each & 1, np.inf, total).argmin(axis=0)
        done = done | 1 << order[place]
        legs = ways[order[place], :looks, every].T
    return order.T


def _share_left(problem: SearchProblem) -> Floats:
    """Return L, `[2^n, S, A]`; one column for all things if it does not matter which are found."""
    q, plans = _list_left(problem), Plans.of(problem)
    if not problem.single or q.shape[2] > JOINT:
        return plans.goes_on(q if problem.single else q[::-1])[..., None]
    return np.asarray((q - plans.every) * plans.given)


def _list_left(problem: SearchProblem) -> Floats:
    """Return Q of every set of looks, `[2^n, S, A]`."""
    q = np.ones((1, len(problem.finds), problem.finds.shape[2]))
    found = np.zeros_like(q)  # in the room of the last look
    for look, finds in enumerate(problem.finds.swapaxes(0, 1)):
        if look:
            room = problem.room
            new = True if room is None else (room[:, look] != room[:, look - 1])[:, None]
            q, found = np.where(new, q * (1 - found).clip(min=0.0), q), np.where(new, 0.0, found)
        q, found = np.concatenate([q, q]), np.concatenate([found, found + finds])
    return np.asarray(q * (1 - found).clip(min=0.0))


@lru_cache(maxsize=8)
def _list_goals(things: int) -> tuple[_Goal, ...]:
    """Return the sets of things, those with fewer things first."""
    return tuple(g for size in range(things) for g in combinations(range(things), size + 1))


def _multiply(left: Floats, goal: _Goal) -> Floats:
    """Return P(none of some things is found) of L `[…, A]`."""
    return left[..., goal[0]] if len(goal) == 1 else np.asarray(left[..., list(goal)].prod(axis=-1))


def _go_on(goal: _Goal, paid: Mapping[_Goal, Floats], now: Floats, then: Floats) -> Floats:
    """Return what is left to pay after one more look, weighted by what it leaves.

    Args:
        goal: things that are not found before it.
        paid: goal → what is left to pay after it.
        now: L before it, `[…, A]`.
        then: L after it.
    """
    cost = paid[goal]
    for some in paid:
        if len(some) < len(goal) and {*some} < {*goal}:
            found = tuple(thing for thing in goal if thing not in some)
            cost = cost + paid[some] * _multiply(now - then, found)
    return cost


@lru_cache(maxsize=64)
def _layers(looks: int, in_turn: tuple[int, ...]) -> tuple[tuple[Ints, Ints, Ints], ...]:
    """Return sets of looks of one size, the looks inside and outside; the largest sets first.

    Looks `in_turn` are in no set without the look before them.
    """
    sets = np.arange(1 << looks)
    for look in in_turn:
        sets = sets[(sets >> look & 1) <= (sets >> (look - 1) & 1)]
    inside = (sets[:, None] >> np.arange(looks) & 1).astype(bool)
    layers = []
    for size in range(looks - 1, 0, -1):
        some = inside[inside.sum(axis=1) == size]
        parts = (np.nonzero(part)[1].reshape(len(some), -1) for part in (some, ~some))
        layers.append((sets[inside.sum(axis=1) == size], *parts))
    return tuple(layers)


# Within a budget


def _plan_in_time(problem: SearchProblem) -> Ints:
    """Return the plans that most likely find things within the budget; the rest comes last.

    Of sets of looks that are nearly as good, it is that whose mean time to find them is least.
    """
    return np.stack([_plan_one(problem.take(slice(k, k + 1))) for k in range(len(problem.finds))])


def _plan_one(problem: SearchProblem) -> Ints:
    looks, q = problem.looks, _list_left(problem)
    fastest, before = _find_fastest(problem)
    w = Plans.of(problem).goes_on(q if problem.single else q[::-1])[:, 0]
    in_time = fastest.min(axis=1) <= (problem.budget or 0.0)
    in_time[0] = True
    good = np.flatnonzero(in_time & (w <= w[in_time].min() + _NEARLY))
    plans = [
        _order_set(problem, int(chosen), fastest, before)
        for chosen in good[w[good].argsort()][:_TRIED]
    ]
    best = min(plans, key=lambda plan: _mean_time(problem, plan))
    return np.array([*best, *(look for look in range(looks) if look not in best)])


def _find_fastest(problem: SearchProblem) -> tuple[Floats, Ints]:
    """Return when sets of looks have ended, `[2^n, n]` by the last one, and the look before it."""
    looks, legs = problem.looks, problem.legs[0]
    fastest, before = np.full((1 << looks, looks), np.inf), np.zeros((1 << looks, looks), int)
    each = np.arange(looks)
    fastest[1 << each, each] = problem.delay[0, 0] + legs[looks]
    for sets, inside, outside in reversed(_layers(looks, ())):
        ends = (
            fastest[sets[:, None], inside][:, :, None] + legs[inside[:, :, None], outside[:, None]]
        )
        after = sets[:, None] | 1 << outside
        fastest[after, outside] = ends.min(axis=1)
        before[after, outside] = np.take_along_axis(inside, ends.argmin(axis=1), axis=1)
    return fastest, before


def _order_set(problem: SearchProblem, chosen: int, fastest: Floats, before: Ints) -> list[int]:
    """Return the order of a set of looks that costs least, or the fastest, to be in time."""
    some = np.flatnonzero(chosen >> np.arange(problem.looks) & 1)
    if not len(some):
        return []
    part = replace(
        problem,
        legs=problem.legs[:, np.append(some, problem.looks)][:, :, some],
        finds=problem.finds[:, some],
        room=None if problem.room is None else problem.room[:, some],
        in_turn=(),
    )
    order: list[int] = some[_plan_exactly(part)[0]].tolist()
    if len(problem.cut(order, robot=0)) == len(order):
        return order
    order, last = [], int(fastest[chosen].argmin())
    while chosen:
        order.append(last)
        chosen, last = chosen & ~(1 << last), int(before[chosen, last])
    return order[::-1]


def _mean_time(problem: SearchProblem, looks: list[int]) -> float:
    """Return the mean time until things are found, or the budget is spent."""
    path = [problem.looks, *looks]
    ends = problem.delay[0, 0] + problem.legs[0, path[:-1], path[1:]].cumsum()
    left = 1 - np.append(0.0, problem.found(looks).prod(axis=1))
    return float(np.diff(ends, prepend=0.0, append=problem.budget or 0.0) @ left)


# By local search


def _plan_locally(problem: SearchProblem, *, chances: int) -> Ints:
    """Return the best of some improved plans, into which looks were put in turn."""
    searches, looks = problem.finds.shape[:2]
    effort = _choose_effort(problem, chances)
    likely, near = problem.finds.max(axis=2), problem.legs[:, looks:].min(axis=1)
    lots = np.random.default_rng(0).random((effort.chances, looks)).repeat(searches, axis=0)
    ranks = np.concatenate([-likely, near, -likely / (near + _ROUNDING), lots])
    turns = np.argsort(ranks, axis=1, kind="stable").T
    plans = Plans.of(problem, copies=len(ranks) // searches)
    path = plans.begin()
    for look in turns:
        path = put(path, look, plans.find_place(path, look))
    costs = plans.expect_path(path)
    if effort.improved is not None:
        best = _best_of(costs, searches, number=effort.improved)
        plans, path, costs = plans.take(best), path[:, best], costs[best]
    _improve(plans, path, costs, effort)
    return np.asarray(path[1:, _best_of(costs, searches)].T)


class _Effort(NamedTuple):
    """How thoroughly plans are made."""

    chances: int  # plans that begin at random
    improved: int | None  # the cheapest plans, which alone are improved; None: all
    every: bool  # whether all looks are tried again, one after another


def _choose_effort(problem: SearchProblem, chances: int) -> _Effort:
    """Return how thoroughly plans are made: less so, where that is nearly as good."""
    looks, is_team, is_timed = problem.looks, problem.robots > 1, problem.budget is not None
    few, many = looks <= EXACT, looks > _SEVERAL
    if is_team and (few or is_timed or not problem.single):  # with many plans near the best
        return _Effort(_TEAM_LOOKS // looks, 1 if many else None, few)
    chances = min(chances, _LOOKS // looks) if many else chances
    if few or (looks <= _THOROUGH and problem.room is None and not is_team and not is_timed):
        return _Effort(chances, None, every=True)
    shared = 0.0 if problem.room is None else share_rooms(problem.room).mean()
    easy = not is_timed and (is_team or 0 < shared < _SHARED)
    return _Effort(chances, 1 if many else _IMPROVED if easy else None, every=False)


def _best_of(costs: Floats, searches: int, *, number: int = 1) -> Ints:
    """Return the numbers of each search's cheapest plans, `[number · S]`."""
    best = costs.reshape(-1, searches).argsort(axis=0, kind="stable")[:number]
    return np.asarray(best * searches + np.arange(searches)).ravel()


def _improve(plans: Plans, path: Ints, cost: Floats, effort: _Effort) -> None:
    """Take out each look and put it in again, as long as that improves a path `[m, B]`.

    If not every look is tried, those are that had moved if they had come first.
    """
    least = _ROUNDING if effort.improved is None else _LEAST_OF_MANY
    looks, going = range(plans.problem.looks), np.arange(path.shape[1])
    while len(going):
        some, now = path[:, going], cost[going]
        for look in looks if effort.every else _find_movers(plans, some):
            place, others = _take_out(some, look)
            new = plans.find_place(others, look)
            moved = np.flatnonzero(new != place)
            if len(moved):
                other = put(others[:, moved], look, new[moved])
                if plans.is_by_turns:
                    then = plans.take(moved).expect_path(other)
                    better = then < now[moved]
                    moved, other = moved[better], other[:, better]
                    now[moved] = then[better]
                some[:, moved] = other
        now = plans.expect_path(some)
        better = now < cost[going] * (1 - least)
        plans, going, some, now = plans.take(better), going[better], some[:, better], now[better]
        path[:, going], cost[going] = some, now


def _take_out(path: Ints, look: Ints | int) -> tuple[Ints, Ints]:
    """Return where a look is in paths `[m, B]`, and the paths without it."""
    place = (path == look).argmax(axis=0)
    return place, np.where(np.arange(len(path) - 1)[:, None] < place, path[:-1], path[1:])


def _find_movers(plans: Plans, path: Ints) -> list[int]:
    """Return the looks that would cost less elsewhere, in any of some paths `[m, B]`."""
    which = plans.take_turns(path)
    if plans.problem.single:
        which = which[:_SEVERAL]  # later ones cost next to nothing, wherever they are
    number, which = len(which), which.ravel()
    place, others = _take_out(np.tile(path, number), which)
    new = plans.take(np.tile(np.arange(path.shape[1]), number)).find_place(others, which)
    moved: list[int] = np.unique(which[new != place]).tolist()
    return moved
