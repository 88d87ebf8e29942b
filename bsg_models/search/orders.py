"""Order rooms so that the expected cost of a search is least.

A plan is an order v₁ … vₙ of the unexplored rooms, from the robot's position. Leg k costs d(vₖ₋₁,
vₖ) and is walked only if the search is still running, so

    expected cost = Σₖ d(vₖ₋₁, vₖ) · w(v₁ … vₖ₋₁)

with w the probability that the search continues after these rooms. With q the probability that a
room holds no instance of a class, rooms being independent:

    all       w = 1 − Π_{unvisited} Π_classes q                       something is left
    single    w = 1 − Π_classes (1 − u),                              a class is still to be found
              u = (Π_visited q − Π_all q) / (1 − Π_all q)             given that it is somewhere

Up to `EXACT` rooms, dynamic programming over sets of rooms (Held and Karp 1962) finds the best
order. Beyond, rooms are inserted one by one where they cost least; then each is taken out and
inserted again until nothing improves. The best of several such orders counts. They begin with the
likeliest room, the nearest, the likeliest for what it costs, or at random. Passing through an
unexplored room on the way to another explores it. Such a plan costs the same as one that names the
room, so orders with the cheapest ways between rooms miss nothing.

Arrays are of B searches at once:

    ways     [B, n + 1, n + 1] costs between rooms; the last row is from the robot's position
    miss     [B, n, A] q of each class; 1 for one that is found
    order    [B, n] rooms
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import lru_cache, partial

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints

EXACT = 10  # rooms; each further room doubles time and memory
CHANCES = 5  # orders that begin at random; more are better and take longer
_EXACT_TOUR, _TOUR_CHANCES = 12, 60  # a tour is planned once in a search
LEAST = 1e-6  # least presence: a wrong belief must not end a search
_CELLS = 1 << 19  # of tables; more searches are ordered in turns
_LEAST_COST = 1e-9  # that a room's likelihood is divided by
_LEAST_SHARE = 1e-9  # least relative improvement


def choose_rooms(
    costs: Floats, here: Ints, rooms: Bools, presence: Floats, *, wanted: Bools, single: bool
) -> Ints:
    """Return the first room of the best order of each of E searches, `[E]`; −1 without rooms.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        rooms: `[E, N]` to be visited.
        presence: `[E, N, A]` P(at least one instance) of A classes.
        wanted: `[E, A]` classes still to be found.
        single: whether one instance of each class is enough.
    """
    miss = np.where(wanted[:, None], 1 - np.clip(presence, LEAST, 1), 1.0)
    first = np.full(len(here), -1)
    for some, which in _by_number(rooms):
        ways, part = _take(costs, here, some, which), miss[some[:, None], which]
        order = order_rooms(ways, part, single=single)
        first[some] = which[np.arange(len(some)), order[:, 0]]
    return first


def plan_tours(costs: Floats, here: Ints, holds: Bools) -> Ints:
    """Return the position of each room in a shortest way through some rooms, `[E, N]`.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N]` rooms to be visited; other rooms come last.
    """
    places = np.full(holds.shape, holds.shape[1])
    for some, which in _by_number(holds):
        certain = np.full((*which.shape, 1), LEAST)
        ways = _take(costs, here, some, which)
        order = order_rooms(ways, certain, single=False, exact=_EXACT_TOUR, chances=_TOUR_CHANCES)
        rooms = np.take_along_axis(which, order, axis=1)
        places[some[:, None], rooms] = np.arange(which.shape[1])
    return places


def choose_cover(costs: Floats, here: Ints, holds: Bools, *, wanted: Bools) -> Ints:
    """Return the first room of the cheapest way that passes an instance of each class, `[E]`.

    It is exact for any number of rooms: dynamic programming over the sets of classes found. −1 if
    a class is nowhere.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N, A]` rooms that hold an instance.
        wanted: `[E, A]` classes still to be found.
    """
    searches, nodes, classes = holds.shape
    bits = 1 << np.arange(classes)
    finds = ((holds & wanted[:, None]) * bits).sum(axis=2)  # the set of classes of a room
    shape = (searches, 1 << classes, nodes)
    cost = np.full(shape, np.inf)  # of having found a set, and being in a room
    first = np.full(shape, -1)
    e, room = np.nonzero(finds)
    cost[e, finds[e, room], room], first[e, finds[e, room], room] = costs[e, here[e], room], room
    for found in range(1, shape[1]):  # a leg that finds something leads to a larger set
        via = (cost[:, found, :, None] + costs).argmin(axis=1)
        e, room = np.nonzero(finds & ~found)
        before, after = via[e, room], found | finds[e, room]
        new = cost[e, found, before] + costs[e, before, room]
        better = new < cost[e, after, room]
        e, room, before, after = e[better], room[better], before[better], after[better]
        cost[e, after, room], first[e, after, room] = new[better], first[e, found, before]
    every, goal = np.arange(searches), (wanted * bits).sum(axis=1)
    last = cost[every, goal].argmin(axis=1)
    return np.asarray(first[every, goal, last])


def order_rooms(
    ways: Floats, miss: Floats, *, single: bool, exact: int = EXACT, chances: int = CHANCES
) -> Ints:
    """Return a best order of n rooms in each of B searches, `[B, n]`.

    Args:
        ways: `[B, n + 1, n + 1]` costs; the last row is from the robot's position.
        miss: `[B, n, A]` q, of the classes that are still to be found; 1 of others.
        single: whether one instance of each class is enough.
        exact: largest number of rooms that is ordered exactly.
        chances: number of further orders that begin at random, for more rooms.
    """
    if not single:
        miss = miss.prod(axis=2, keepdims=True)
    searches, rooms = miss.shape[:2]
    if rooms <= exact:
        cells, order = rooms << rooms, _order_exactly
    else:
        cells, order = (3 + chances) * rooms**2, partial(_order_many, chances=chances)
    together = max(1, _CELLS // cells)
    parts = [slice(i, i + together) for i in range(0, searches, together)]
    return np.concatenate([order(ways[part], miss[part], single) for part in parts])


def expected_costs(ways: Floats, miss: Floats, order: Ints, *, single: bool) -> Floats:
    """Return the expected cost of an order of each search, `[B]`; arguments as in `order_rooms`."""
    if not single:
        miss = miss.prod(axis=2, keepdims=True)
    before, after = _products(miss, order)
    goes_on = _goes_on(before, after, before[:, -1:], single)[:, :-1]
    places = _append_start(order, miss)
    legs = np.take_along_axis(
        ways[np.arange(len(order))[:, None], places[:, :-1]], order[..., None], 2
    )
    return np.asarray((legs[..., 0] * goes_on).sum(axis=1))


def _by_number(rooms: Bools) -> Iterator[tuple[Ints, Ints]]:
    """Yield the searches `[B]` that have equally many rooms, and these `[B, n]`."""
    numbers = rooms.sum(axis=1)
    for number in np.unique(numbers[numbers > 0]).tolist():
        some = np.flatnonzero(numbers == number)
        yield some, np.nonzero(rooms[some])[1].reshape(-1, number)


def _take(costs: Floats, here: Ints, some: Ints, which: Ints) -> Floats:
    """Return the costs between rooms `[B, n]` of some searches, and from the robot's position."""
    nodes = np.concatenate([which, here[some, None]], axis=1)
    return np.asarray(costs[some[:, None, None], nodes[:, :, None], nodes[:, None]])


def _goes_on(before: Floats, after: Floats, every: Floats, single: bool) -> Floats:
    """Return w, given the products of q over the rooms before, from then on, and all `[…, A]`."""
    if not single:
        return np.asarray(1 - after[..., 0])
    somewhere = np.broadcast_to(1 - every, np.broadcast_shapes(before.shape, every.shape))
    left = np.divide(before - every, somewhere, out=np.zeros(somewhere.shape), where=somewhere > 0)
    return np.asarray(1 - (1 - left).prod(axis=-1))


def _products(miss: Floats, order: Ints) -> tuple[Floats, Floats]:
    """Return the products of q over the rooms before each place and from it on, `[B, n + 1, A]`."""
    ordered = np.take_along_axis(miss, order[..., None], axis=1)
    one = np.ones((len(order), 1, miss.shape[2]))
    before = np.concatenate([one, ordered], axis=1).cumprod(axis=1)
    after = np.concatenate([one, ordered[:, ::-1]], axis=1).cumprod(axis=1)[:, ::-1]
    return before, after


def _append_start(order: Ints, miss: Floats) -> Ints:
    """Return the places of an order with the robot's before them, `[B, n + 1]`."""
    return np.concatenate([np.full((len(order), 1), miss.shape[1]), order], axis=1)


def _order_exactly(ways: Floats, miss: Floats, single: bool) -> Ints:
    """Return the best order, from the least cost that remains after a set, in its last room."""
    ways, rooms = ways.transpose(1, 2, 0), miss.shape[1]  # searches last: they are contiguous
    visited = np.ones((1, *miss[:, 0].shape))
    for room in range(rooms):
        visited = np.concatenate([visited, visited * miss[:, room]])
    goes_on = _goes_on(visited, visited[::-1], visited[-1], single)
    remaining = np.zeros((1 << rooms, rooms, len(miss)))
    for sets, inside, outside in _layers(rooms):
        legs = ways[inside[:, :, None], outside[:, None]] * goes_on[sets][:, None, None]
        legs += remaining[sets[:, None] | 1 << outside, outside][:, None]
        remaining[sets[:, None], inside] = legs.min(axis=2)
    every, each = np.arange(len(miss)), np.arange(rooms)[:, None]
    order = np.empty((rooms, len(miss)), dtype=np.int64)
    done, legs = np.zeros(len(miss), dtype=np.int64), ways[rooms, :rooms]
    for place in range(rooms):
        total = legs * goes_on[done, every] + remaining[done | 1 << each, each, every]
        order[place] = np.where(done >> each & 1, np.inf, total).argmin(axis=0)
        done = done | 1 << order[place]
        legs = ways[order[place], :rooms, every].T
    return order.T


@lru_cache(maxsize=16)
def _layers(rooms: int) -> tuple[tuple[Ints, Ints, Ints], ...]:
    """Return sets of rooms of one size, the rooms inside and outside; the largest sets first."""
    sets = np.arange(1 << rooms)
    inside = (sets[:, None] >> np.arange(rooms) & 1).astype(bool)
    layers = []
    for size in range(rooms - 1, 0, -1):
        some = sets[inside.sum(axis=1) == size]
        parts = (
            np.nonzero(part)[1].reshape(len(some), -1) for part in (inside[some], ~inside[some])
        )
        layers.append((some, *parts))
    return tuple(layers)


def _order_many(ways: Floats, miss: Floats, single: bool, *, chances: int) -> Ints:
    """Return the best of 3 + `chances` improved orders, into which rooms were inserted in turn."""
    searches, rooms = miss.shape[:2]
    likely, near = 1 - miss.min(axis=2), ways[:, rooms, :rooms]
    lots = np.repeat(np.random.default_rng(0).random((chances, rooms)), searches, axis=0)
    ranks = np.concatenate([-likely, near, -likely / (near + _LEAST_COST), lots])
    turns = np.argsort(ranks, axis=1, kind="stable")
    ways, miss = np.tile(ways, (3 + chances, 1, 1)), np.tile(miss, (3 + chances, 1, 1))
    order = turns[:, :0]
    for room in turns.T:
        order = _insert(ways, miss, order, room, single)
    order = _improve(ways, miss, order, single)
    costs = expected_costs(ways, miss, order, single=single).reshape(-1, searches)
    best = costs.argmin(axis=0) * searches + np.arange(searches)
    return np.asarray(order[best])


def _improve(ways: Floats, miss: Floats, order: Ints, single: bool) -> Ints:
    """Take out each room and insert it again, as long as that improves an order."""
    cost = expected_costs(ways, miss, order, single=single)
    going = np.arange(len(order))
    while len(going):
        some, of_ways, of_miss = order[going], ways[going], miss[going]
        for room in range(order.shape[1]):
            rest = some[some != room].reshape(len(some), -1)
            some = _insert(of_ways, of_miss, rest, np.full(len(some), room), single)
        now = expected_costs(of_ways, of_miss, some, single=single)
        better = now < cost[going] * (1 - _LEAST_SHARE)
        going, some, now = going[better], some[better], now[better]
        order[going], cost[going] = some, now
    return order


def _insert(ways: Floats, miss: Floats, order: Ints, room: Ints, single: bool) -> Ints:
    """Insert a room `[B]` into orders of m other rooms where it costs least, `[B, m + 1]`.

    Legs before it are walked as if it were unvisited, later ones as if it were visited.
    """
    e, of_room = np.arange(len(order)), miss[np.arange(len(order)), room][:, None]
    (before, after), every = _products(miss, order), miss.prod(axis=1, keepdims=True)
    unvisited = _goes_on(before, after * of_room, every, single)
    visited = _goes_on(before * of_room, after, every, single)
    places, none = _append_start(order, miss), np.zeros((len(order), 1))
    legs = ways[e[:, None], places[:, :-1], order]
    head = np.concatenate([none, legs * unvisited[:, :-1]], axis=1).cumsum(axis=1)
    tail = np.concatenate([none, (legs * visited[:, :-1])[:, ::-1]], axis=1).cumsum(axis=1)[:, ::-1]
    tail = np.concatenate([tail[:, 1:], none], axis=1)
    into = ways[e[:, None], places, room[:, None]] * unvisited
    onwards = np.concatenate(
        [ways[e[:, None], room[:, None], order] * visited[:, :-1], none], axis=1
    )
    place = (head + into + onwards + tail).argmin(axis=1)[:, None]
    at, new = np.arange(order.shape[1] + 1), room[:, None]
    return np.where(
        at < place,
        np.concatenate([order, new], axis=1),
        np.where(at == place, new, np.concatenate([new, order], axis=1)),
    )
