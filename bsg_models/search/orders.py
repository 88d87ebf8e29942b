"""In which order to visit rooms, so that a search is expected to cost least.

A plan is an order v₁ … vₙ of the unexplored rooms, from where the robot is. Leg k costs d(vₖ₋₁, vₖ)
and is walked only if the search goes on until then, so that

    expected cost = Σₖ d(vₖ₋₁, vₖ) · w(v₁ … vₖ₋₁)

with w the probability that the search goes on after these rooms. With q the probability that a room
holds no instance of a class, rooms being independent:

    all       w = 1 − Π_{unvisited} Π_classes q                       something is left
    single    w = 1 − Π_classes (1 − u),                              a class is still to be found
              u = (Π_visited q − Π_all q) / (1 − Π_all q)             given that it is somewhere

The best order is found by dynamic programming over sets of rooms (Held and Karp) up to `EXACT`
rooms, and beyond by moving and turning parts of several good orders until nothing gets better.
Passing through an unexplored room on the way to another explores it; such a plan costs as much as
the one that names it, so that orders with the cheapest ways between rooms leave nothing out.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
from numba import njit

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
EXACT = 9  # rooms; each more doubles the time and memory
LONGEST = 3  # rooms that are moved together
LEAST = 1e-6  # no room is certainly empty: a wrong belief must not end a search


def choose_rooms(
    costs: Floats,
    here: Ints,
    rooms: Bools,
    presence: Floats,
    *,
    wanted: Bools,
    single: bool,
    exact: int = EXACT,
) -> Ints:
    """Return the first room of the best order of each of E searches, `[E]`; −1 without rooms.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        rooms: `[E, N]` to be visited.
        presence: `[E, N, A]` P(at least one instance) of A classes.
        wanted: `[E, A]` classes still to be found.
        single: whether one instance of each class is enough.
        exact: most rooms that are ordered exactly.

    Raises:
        ValueError: if a presence is not finite.
    """
    if not np.isfinite(presence).all():
        # With NaN, compiled code would read outside its arrays.
        raise ValueError("presence must be finite")
    miss = 1.0 - np.clip(presence, LEAST, 1.0)
    miss = np.where(wanted[:, None, :], miss, 1.0)
    if not single:
        miss = miss.prod(axis=2, keepdims=True)
        wanted = np.asarray(wanted.any(axis=1, keepdims=True))
    return np.asarray(_choose(costs, here, rooms, miss, wanted, single, exact))


def plan_tours(costs: Floats, here: Ints, holds: Bools, *, exact: int, kicks: int) -> Ints:
    """Return the place of each room in the shortest way through some rooms, `[E, N]`.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N]` rooms to be visited; the others' places come last.
        exact: most rooms that are ordered exactly.
        kicks: times that a good order is disturbed and improved anew.
    """
    return np.asarray(_plan_tours(costs, here, holds, exact, kicks))


def choose_cover(costs: Floats, here: Ints, holds: Bools, *, wanted: Bools) -> Ints:
    """Return the first room of the cheapest way that passes an instance of each class, `[E]`.

    Exact, whatever the number of rooms: dynamic programming over the sets of classes found.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N, A]` rooms that hold an instance.
        wanted: `[E, A]` classes still to be found.
    """
    return np.asarray(_choose_cover(costs, here, holds & wanted[:, None], wanted))


def order_rooms(
    costs: Floats, here: int, miss: Floats, *, single: bool, exact: int = EXACT
) -> Ints:
    """Return the best order of rooms 0..n−1 for one search, `[n]`.

    Args:
        costs: `[n + 1, n + 1]` between rooms, and from `here`.
        here: row of where the robot is.
        miss: `[n, A]` q, of classes that are all still to be found.
        single: whether one instance of each class is enough.
        exact: most rooms that are ordered exactly.
    """
    return np.asarray(_order(costs, here, np.arange(len(miss)), miss, single, exact, 0))


def expected_cost(costs: Floats, here: int, miss: Floats, order: Ints, *, single: bool) -> float:
    """Return the expected cost of an order; arguments as of `order_rooms`."""
    products, legs = np.ones((len(miss) + 1, miss.shape[1])), np.zeros(len(miss) + 1)
    _sum_legs(costs, here, np.arange(len(miss)), miss, single, order, products, legs)
    return float(legs[-1])


@njit(cache=True)
def _choose(costs, here, rooms, miss, wanted, single, exact):  # type: ignore[no-untyped-def]
    target = np.full(len(here), -1)
    for e in range(len(here)):
        which = np.flatnonzero(rooms[e])
        classes = np.flatnonzero(wanted[e])
        if len(which) == 0:
            continue
        part = np.empty((len(which), len(classes)))
        for i in range(len(which)):
            for a in range(len(classes)):
                part[i, a] = miss[e, which[i], classes[a]]
        order = _order(costs[e], here[e], which, part, single, exact, 0)
        target[e] = which[order[0]]
    return target


@njit(cache=True)
def _plan_tours(costs, here, holds, exact, kicks):  # type: ignore[no-untyped-def]
    places = np.full(holds.shape, holds.shape[1])
    for e in range(len(here)):
        which = np.flatnonzero(holds[e])
        if len(which):
            certain = np.full((len(which), 1), LEAST)
            order = _order(costs[e], here[e], which, certain, False, exact, kicks)
            for k in range(len(which)):
                places[e, which[order[k]]] = k
    return places


@njit(cache=True)
def _choose_cover(costs, here, holds, wanted):  # type: ignore[no-untyped-def]
    target = np.full(len(here), -1)
    for e in range(len(here)):
        classes = np.flatnonzero(wanted[e])
        nodes, sets = holds.shape[1], 1 << len(classes)
        finds = np.zeros(nodes, dtype=np.int64)  # the set of classes that a room holds
        for n in range(nodes):
            for i in range(len(classes)):
                if holds[e, n, classes[i]]:
                    finds[n] |= 1 << i
        cost = np.full((sets, nodes), np.inf)  # of having found a set, and being in a room
        first = np.full((sets, nodes), -1)
        for n in range(nodes):
            if finds[n]:
                cost[finds[n], n], first[finds[n], n] = costs[e, here[e], n], n
        for s in range(1, sets):  # a leg that finds something leads to a larger set
            for n in range(nodes):
                if cost[s, n] == np.inf:
                    continue
                for m in range(nodes):
                    after = s | finds[m]
                    if after != s and cost[s, n] + costs[e, n, m] < cost[after, m]:
                        cost[after, m] = cost[s, n] + costs[e, n, m]
                        first[after, m] = first[s, n]
        best = np.inf
        for n in range(nodes):
            if cost[sets - 1, n] < best:
                best, target[e] = cost[sets - 1, n], first[sets - 1, n]
    return target


@njit(cache=True)
def _order(costs, here, rooms, miss, single, exact, kicks):  # type: ignore[no-untyped-def]
    if len(rooms) <= exact:
        return _order_exactly(costs, here, rooms, miss, single)
    best = np.arange(len(rooms))
    best_cost = np.inf
    for start in range(3):
        order = _begin(costs, here, rooms, miss, start)
        cost = _improve(costs, here, rooms, miss, single, order)
        if cost < best_cost:
            best, best_cost = order, cost
    state = 1
    for _ in range(kicks):
        order = best.copy()
        for _ in range(3):  # exchange rooms at random, always the same way
            state = (state * 1103515245 + 12345) % 2147483648
            i = state // 65536 % len(order)
            state = (state * 1103515245 + 12345) % 2147483648
            j = state // 65536 % len(order)
            order[i], order[j] = order[j], order[i]
        cost = _improve(costs, here, rooms, miss, single, order)
        if cost < best_cost:
            best, best_cost = order, cost
    return best


@njit(cache=True)
def _begin(costs, here, rooms, miss, start):  # type: ignore[no-untyped-def]
    """Return an order to start from: nearest first, likeliest first, or most likely a cost."""
    left = len(rooms)
    order = np.empty(left, dtype=np.int64)
    open_ = np.ones(left, dtype=np.bool_)
    place = here
    for k in range(left):
        best, best_score = -1, -np.inf
        for i in range(left):
            if not open_[i]:
                continue
            hit, distance = 1.0 - miss[i].min(), costs[place, rooms[i]]
            if start == 0:
                score = -distance
            elif start == 1:
                score = hit
            else:
                score = hit / (distance + 1e-9)
            if best < 0 or score > best_score:
                best, best_score = i, score
        order[k] = best
        open_[best] = False
        place = rooms[best]
    return order


@njit(cache=True)
def _improve(costs, here, rooms, miss, single, order):  # type: ignore[no-untyped-def]
    """Improve an order in place until no move helps; return its cost.

    A move changes the places from `low` to `high` alone, and which rooms are visited before and
    after these stays: only the legs into them and into the next place are compared.
    """
    n = len(order)
    products, legs = np.ones((n + 1, miss.shape[1])), np.zeros(n + 1)
    _sum_legs(costs, here, rooms, miss, single, order, products, legs)
    trial = order.copy()
    improved = True
    while improved:
        improved = False
        for length in range(min(LONGEST, n - 1) + 1):
            for i in range(n):
                for j in range(n):
                    if length == 0:  # turn a part where it is
                        low, high = i, j
                        if i >= j:
                            continue
                        for k in range(low, high + 1):
                            trial[k] = order[low + high - k]
                    else:  # move a part from i to j
                        low, high = min(i, j), max(i, j) + length - 1
                        if i == j or high >= n:
                            continue
                        for k in range(i, j):
                            trial[k] = order[k + length]
                        for k in range(j, i):
                            trial[k + length] = order[k]
                        for k in range(length):
                            trial[j + k] = order[i + k]
                    limit = legs[min(high + 2, n)] - legs[low] - 1e-9 * legs[n]
                    cost = _window(
                        costs, here, rooms, miss, single, trial, products, low, high, limit
                    )
                    if cost < limit:
                        order[low : high + 1] = trial[low : high + 1]
                        _sum_legs(costs, here, rooms, miss, single, order, products, legs)
                        improved = True
                    else:
                        trial[low : high + 1] = order[low : high + 1]
    return legs[n]


@njit(cache=True)
def _window(costs, here, rooms, miss, single, trial, products, low, high, limit):  # type: ignore[no-untyped-def]
    """Return what the legs into the places from low to high + 1 cost, or something above limit.

    `products` and the places outside of it are those before the move.
    """
    n, classes = miss.shape
    total, last = 0.0, min(high + 1, n - 1)
    if not single:  # from the end: what is left after the window is left as before
        left = products[last + 1, 0]
        for k in range(last, low - 1, -1):
            left *= miss[trial[k], 0]
            before = rooms[trial[k - 1]] if k else here
            total += costs[before, rooms[trial[k]]] * (1.0 - left)
            if total >= limit:
                return total
        return total
    product = products[low].copy()
    place = rooms[trial[low - 1]] if low else here
    for k in range(low, last + 1):
        room = rooms[trial[k]]
        over = 1.0
        for a in range(classes):
            over *= 1.0 - (product[a] - products[n, a]) / (1.0 - products[n, a])
            product[a] *= miss[trial[k], a]
        total += costs[place, room] * (1.0 - over)
        if total >= limit:
            return total
        place = room
    return total


@njit(cache=True)
def _sum_legs(costs, here, rooms, miss, single, order, products, legs):  # type: ignore[no-untyped-def]
    """Write products of q `[n + 1, A]` and sums of the costs of legs `[n + 1]` of an order.

    `single` has the products over the places before each, `all` those from each place on.
    """
    n, classes = miss.shape
    if single:
        for k in range(n):
            for a in range(classes):
                products[k + 1, a] = products[k, a] * miss[order[k], a]
    else:
        for k in range(n - 1, -1, -1):
            products[k, 0] = products[k + 1, 0] * miss[order[k], 0]
    place = here
    for k in range(n):
        room = rooms[order[k]]
        over = 1.0
        if single:
            for a in range(classes):
                over *= 1.0 - (products[k, a] - products[n, a]) / (1.0 - products[n, a])
        else:
            over = products[k, 0]
        legs[k + 1] = legs[k] + costs[place, room] * (1.0 - over)
        place = room


@njit(cache=True)
def _order_exactly(costs, here, rooms, miss, single):  # type: ignore[no-untyped-def]
    """Return the best order by dynamic programming over the sets of visited rooms."""
    n, classes = miss.shape
    sets = 1 << n
    product = np.ones((sets, classes))
    for s in range(1, sets):
        lowest = 0
        while not s >> lowest & 1:
            lowest += 1
        product[s] = product[s & (s - 1)] * miss[lowest]
    goes_on = np.empty(sets)
    for s in range(sets):
        over = 1.0
        for a in range(classes):
            every = product[sets - 1, a]
            if single:
                over *= 1.0 - (product[s, a] - every) / (1.0 - every)
            else:
                over *= product[sets - 1 - s, a]
        goes_on[s] = 1.0 - over
    value = np.zeros((sets, n))  # least cost to come, after the set with a room of it the last
    following = np.zeros((sets, n), dtype=np.int64)
    for s in range(sets - 2, 0, -1):
        for last in range(n):
            if not s >> last & 1:
                continue
            best = np.inf
            for room in range(n):
                if s >> room & 1:
                    continue
                cost = costs[rooms[last], rooms[room]] * goes_on[s] + value[s | 1 << room, room]
                if cost < best:
                    best, following[s, last] = cost, room
            value[s, last] = best
    order = np.empty(n, dtype=np.int64)
    best = np.inf
    for room in range(n):
        cost = costs[here, rooms[room]] * goes_on[0] + value[1 << room, room]
        if cost < best:
            best, order[0] = cost, room
    s = 1 << order[0]
    for k in range(1, n):
        order[k] = following[s, order[k - 1]]
        s |= 1 << order[k]
    return order
