"""Order rooms so that the expected cost of a search is least.

A plan is an order v₁ … vₙ of the unexplored rooms, from the robot's position. Leg k costs d(vₖ₋₁,
vₖ) and is walked only if the search is still running, so

    expected cost = Σₖ d(vₖ₋₁, vₖ) · w(v₁ … vₖ₋₁)

with w the probability that the search continues after these rooms. With q the probability that a
room holds no instance of a class, rooms being independent:

    all       w = 1 − Π_{unvisited} Π_classes q                       something is left
    single    w = 1 − Π_classes (1 − u),                              a class is still to be found
              u = (Π_visited q − Π_all q) / (1 − Π_all q)             given that it is somewhere

Up to `EXACT` rooms, dynamic programming over sets of rooms (Held and Karp) finds the best order.
Beyond, parts of several good orders are moved and reversed until nothing improves. Passing through
an unexplored room on the way to another explores it. Such a plan costs the same as one that names
the room, so orders with the cheapest ways between rooms miss nothing.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bsg_models.compilation import compiled
from bsg_models.search.exact_orders import order_exactly, pass_all_classes
from bsg_models.search.order_moves import improve
from bsg_models.search.order_walks import improve_slowly, sum_legs

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
EXACT = 9  # rooms; each further room doubles time and memory
UNLIKELY = 1e-6  # P(each class is somewhere) below which differences of sums are rounding error
LEAST = 1e-6  # least presence: a wrong belief must not end a search


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
        exact: largest number of rooms that is ordered exactly.

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
    return np.asarray(_order_all(costs, here, rooms, miss, wanted, single, exact, 0)[:, 0])


def plan_tours(costs: Floats, here: Ints, holds: Bools, *, exact: int, kicks: int) -> Ints:
    """Return the position of each room in the shortest way through some rooms, `[E, N]`.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N]` rooms to be visited; other rooms come last.
        exact: largest number of rooms that is ordered exactly.
        kicks: number of times that a good order is disturbed and improved again.
    """
    certain = np.full((*holds.shape, 1), LEAST)
    wanted = np.ones((len(here), 1), dtype=bool)
    orders = _order_all(costs, here, holds, certain, wanted, False, exact, kicks)
    places = np.full(holds.shape, holds.shape[1])
    searches, steps = np.nonzero(orders >= 0)
    places[searches, orders[searches, steps]] = steps
    return places


def choose_cover(costs: Floats, here: Ints, holds: Bools, *, wanted: Bools) -> Ints:
    """Return the first room of the cheapest way that passes an instance of each class, `[E]`.

    It is exact for any number of rooms: dynamic programming over the sets of classes found.

    Args:
        costs: `[E, N, N]` of the cheapest ways.
        here: `[E]` node of the robot.
        holds: `[E, N, A]` rooms that hold an instance.
        wanted: `[E, A]` classes still to be found.
    """
    return np.asarray(pass_all_classes(costs, here, holds & wanted[:, None], wanted))


def order_rooms(
    costs: Floats, here: int, miss: Floats, *, single: bool, exact: int = EXACT
) -> Ints:
    """Return the best order of rooms 0..n−1 for one search, `[n]`.

    Args:
        costs: `[n + 1, n + 1]` between rooms, and from `here`.
        here: row of the robot's position.
        miss: `[n, A]` q, of the classes that are still to be found.
        single: whether one instance of each class is enough.
        exact: largest number of rooms that is ordered exactly.
    """
    one, rooms = np.array([here]), np.arange(len(costs))[None] < len(miss)
    padded = np.ones((1, len(costs), miss.shape[1]))
    padded[0, : len(miss)] = miss
    wanted = np.ones((1, miss.shape[1]), dtype=bool)
    orders = _order_all(costs[None], one, rooms, padded, wanted, single, exact, 0)
    return np.asarray(orders[0, : len(miss)])


def expected_cost(costs: Floats, here: int, miss: Floats, order: Ints, *, single: bool) -> float:
    """Return the expected cost of an order; arguments as for `order_rooms`."""
    products, legs = np.ones((len(miss) + 1, miss.shape[1])), np.zeros(len(miss) + 1)
    ways = _take_ways(costs, here, np.arange(len(miss)))
    sum_legs(ways, miss, single, order, products, legs)
    return float(legs[-1])


@compiled()
def _order_all(costs, here, rooms, miss, wanted, single, exact, kicks):  # type: ignore[no-untyped-def]
    """Return the orders of E searches, `[E, N]`; −1 after the last room.

    This is the single entry to the compiled code, because a second one would compile it again.
    """
    orders = np.full(rooms.shape, -1)
    for e in range(len(here)):
        which = np.flatnonzero(rooms[e])
        classes = np.flatnonzero(wanted[e])
        if len(which) == 0:
            continue
        part = np.empty((len(which), len(classes)))
        for i in range(len(which)):
            for a in range(len(classes)):
                part[i, a] = miss[e, which[i], classes[a]]
        ways = _take_ways(costs[e], here[e], which)
        orders[e, : len(which)] = which[_order(ways, part, single, exact, kicks)]
    return orders


@compiled()
def _order(ways, miss, single, exact, kicks):  # type: ignore[no-untyped-def]
    if len(miss) <= exact:
        return order_exactly(ways, miss, single)
    composes = _composes(miss, single)
    best, best_cost, state = np.arange(len(miss)), np.inf, 1
    for turn in range(3 + kicks):
        if turn < 3:
            order = _begin(ways, miss, turn)
        else:
            order, state = _disturb(best, state)
        cost = _improve(ways, miss, single, order, composes)
        if cost < best_cost:
            best, best_cost = order, cost
    return best


@compiled()
def _disturb(order, state):  # type: ignore[no-untyped-def]
    """Return an order with rooms exchanged pseudo-randomly, and the next state.

    The random numbers follow the example of `rand` in the C standard.
    """
    order = order.copy()
    for _ in range(3):
        state = (state * 1103515245 + 12345) % 2147483648
        i = state // 65536 % len(order)
        state = (state * 1103515245 + 12345) % 2147483648
        j = state // 65536 % len(order)
        order[i], order[j] = order[j], order[i]
    return order, state


@compiled()
def _composes(miss, single):  # type: ignore[no-untyped-def]
    """Return whether the terms of `order_moves` are few, and large relative to rounding."""
    n, classes = miss.shape
    if not single:
        return True
    somewhere = 1.0  # P(each class is somewhere)
    for a in range(classes):
        every = 1.0
        for i in range(n):
            every *= miss[i, a]
        somewhere *= 1.0 - every
    return somewhere >= UNLIKELY and classes < 20 and 1 << classes <= max(n, 2)


@compiled()
def _improve(ways, miss, single, order, composes):  # type: ignore[no-untyped-def]
    if composes:
        return improve(ways, miss, single, order)
    return improve_slowly(ways, miss, single, order)


@compiled()
def _take_ways(costs, here, rooms):  # type: ignore[no-untyped-def]
    """Return the costs between some rooms; the last row is from the robot's position."""
    n = len(rooms)
    ways = np.zeros((n + 1, n + 1))
    for i in range(n):
        ways[n, i] = costs[here, rooms[i]]
        for j in range(n):
            ways[i, j] = costs[rooms[i], rooms[j]]
    return ways


@compiled()
def _begin(ways, miss, start):  # type: ignore[no-untyped-def]
    """Return a starting order: nearest first, likeliest first, or by presence per cost."""
    left = len(miss)
    order = np.empty(left, dtype=np.int64)
    open_ = np.ones(left, dtype=np.bool_)
    place = left
    for k in range(left):
        best, best_score = -1, -np.inf
        for i in range(left):
            if not open_[i]:
                continue
            hit, distance = 1.0 - miss[i].min(), ways[place, i]
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
        place = best
    return order
