"""Send several robots to search together, so that the time until one of them finds it is least.

A plan gives each robot an order of rooms of its own. A robot that starts at a time t and takes a
leg of cost d has looked in its room at t + d. With all looks t₁ ≤ t₂ ≤ … of a plan, and w as in
`bsg_models.search.orders`,

    expected time = Σₖ (tₖ − tₖ₋₁) · w(rooms looked into by tₖ₋₁)

Of several things, w is the mean of their own, so that no robot dawdles while another still looks
for its thing.

A plan begins greedily: the robot that is free first takes the room with the highest chance for its
cost. Then one room is put elsewhere, two are exchanged, or the robots exchange what is left, as
long as that helps. Of many rooms, only those that come first are moved.

Arrays are of B plans of n rooms for K robots: `order` `[B, n]` rooms, and `robot` `[B, n]` who goes
there; each robot takes its rooms in this order.
"""

from __future__ import annotations

from functools import lru_cache
from itertools import combinations

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.search.orders import LEAST

_FIRST = 10  # rooms that are put elsewhere: those behind them seldom change the next step
_ROUNDS = 60
_CHANCES, _FEW = 8, 8  # plans that begin at random, of so many rooms at most
_LEAST_SHARE = 1e-9  # least relative improvement


def send_team(
    costs: Floats,
    here: Ints,
    rooms: Bools,
    presence: Floats,
    *,
    single: bool,
    delay: Floats | None = None,
) -> Ints:
    """Return the room that each of K robots goes to first, `[K]`; −1 for one without a room.

    Args:
        costs: `[N, N]` of the cheapest ways, with the looks at their ends.
        here: `[K]` nodes of the robots.
        rooms: `[N]` to be visited.
        presence: `[N, A]` P(a look finds at least one instance) of what is still to be found.
        single: whether one instance of each class is enough.
        delay: `[K]` when each robot is where it starts from; None: all are there now.
    """
    which = np.flatnonzero(rooms)
    first = np.full(len(here), -1)
    if not len(which):
        return first
    legs = costs[np.ix_([*which, *here], which)]
    miss = 1 - np.clip(presence[which], LEAST, 1)
    later = np.zeros(len(here)) if delay is None else delay
    order, robot = plan_team(legs, miss, later, single=single)
    for number in range(len(here)):
        mine = order[robot == number]
        first[number] = which[mine[0]] if len(mine) else -1
    return first


def plan_team(legs: Floats, miss: Floats, delay: Floats, *, single: bool) -> tuple[Ints, Ints]:
    """Return a plan of little expected time: its rooms `[n]`, and who goes there `[n]`.

    Args:
        legs: `[n + K, n]` costs from the rooms, then from each robot, to the rooms.
        miss: `[n, A]` P(a look finds none).
        delay: `[K]` when each robot is where it starts from.
        single: whether one instance of each class is enough.
    """
    if not single:
        miss = miss.prod(axis=1, keepdims=True)
    rooms, robots = len(miss), len(delay)
    rng = np.random.default_rng(0)
    lots = (rng.random((2, rooms)) for _ in range(_CHANCES if rooms <= _FEW else 0))
    starts = [_begin(legs, miss, delay, power=power) for power in (1.0, 0.0, 0.5)]
    starts += [(one.argsort(), (other * robots).astype(np.int64)) for one, other in lots]
    plans = (_improve(legs, miss, *start, delay, single) for start in starts)
    order, robot, _ = min(plans, key=lambda plan: plan[2])
    return order, robot


def expected_times(
    legs: Floats, miss: Floats, order: Ints, robot: Ints, *, delay: Floats, single: bool
) -> Floats:
    """Return the expected time of B plans, `[B]`; arguments as in `plan_team`."""
    (plans, rooms), robots = order.shape, len(delay)
    each, times = np.arange(plans), np.empty(order.shape)
    place = np.tile(np.arange(rooms, rooms + robots), (plans, 1))
    clock = np.tile(delay, (plans, 1))
    for step in range(rooms):
        who, room = robot[:, step], order[:, step]
        times[:, step] = clock[each, who] + legs[place[each, who], room]
        clock[each, who], place[each, who] = times[:, step], room
    turn = np.argsort(times, axis=1, kind="stable")
    times = np.take_along_axis(times, turn, axis=1)
    q = miss[np.take_along_axis(order, turn, axis=1)]  # [B, n, A]
    if single:
        one, every = np.ones((plans, 1, q.shape[2])), miss.prod(axis=0)
        before = np.concatenate([one, q[:, :-1].cumprod(axis=1)], axis=1)
        left = ((before - every) / (1 - every)).mean(axis=2)
    else:
        left = 1 - q[:, ::-1].cumprod(axis=1)[:, ::-1, 0]
    return np.asarray((np.diff(times, axis=1, prepend=0.0) * left).sum(axis=1))


def _begin(legs: Floats, miss: Floats, delay: Floats, *, power: float) -> tuple[Ints, Ints]:
    """Return a greedy plan; `power` 0 sends every robot to the nearest room instead."""
    rooms, robots = len(miss), len(delay)
    likely = (1 - miss.min(axis=1)) ** power
    clock, place = delay.copy(), np.arange(rooms, rooms + robots)
    left = np.ones(rooms, dtype=bool)
    order, robot = np.empty((2, rooms), dtype=np.int64)
    for step in range(rooms):
        who = int(clock.argmin())
        worth = np.where(left, likely / np.maximum(legs[place[who]], 1e-9), -1.0)
        room = int(worth.argmax())
        clock[who] += legs[place[who], room]
        place[who], left[room] = room, False
        order[step], robot[step] = room, who
    return order, robot


def _improve(
    legs: Floats, miss: Floats, order: Ints, robot: Ints, delay: Floats, single: bool
) -> tuple[Ints, Ints, float]:
    """Return a plan that no move of a room improves, and its expected time."""

    def measure(orders: Ints, who: Ints) -> Floats:
        return expected_times(legs, miss, orders, who, delay=delay, single=single)

    time = float(measure(order[None], robot[None])[0])
    for _ in range(_ROUNDS):
        orders, who = _neighbours(order, robot, len(delay))
        if not len(orders):
            break
        times = measure(orders, who)
        best = int(times.argmin())
        if times[best] >= time * (1 - _LEAST_SHARE):
            break
        order, robot, time = orders[best], who[best], float(times[best])
    return order, robot, time


def _neighbours(order: Ints, robot: Ints, robots: int) -> tuple[Ints, Ints]:
    """Return the plans in which one room comes elsewhere, or two are exchanged."""
    turns, moved, goer = _moves(len(order), robots)
    who = np.where(turns == moved[:, None], goer[:, None], robot[turns])
    swaps, tails = _exchanges(len(order), robots)
    orders = [order[turns], order[swaps], np.broadcast_to(order, (len(tails), len(order)))]
    others = [who, np.broadcast_to(robot, swaps.shape), (robot + tails) % robots]
    return np.concatenate(orders), np.concatenate(others)


@lru_cache(maxsize=16)
def _moves(rooms: int, robots: int) -> tuple[Ints, Ints, Ints]:
    """Return new turns `[M, n]` of the rooms, which of them is moved, and to which robot, `[M]`."""
    first = min(rooms, _FIRST)
    turns, moved, goer = [], [], []
    for a in range(first):
        rest = [place for place in range(rooms) if place != a]
        for b in range(first):
            for one in range(robots):
                turns.append([*rest[:b], a, *rest[b:]])
                moved.append(a)
                goer.append(one)
    return np.array(turns).reshape(-1, rooms), np.array(moved), np.array(goer)


@lru_cache(maxsize=16)
def _exchanges(rooms: int, robots: int) -> tuple[Ints, Ints]:
    """Return turns with two rooms exchanged, and by how much the robots of later rooms change."""
    first = min(rooms, _FIRST)
    swaps = []
    for a, b in combinations(range(first), 2):
        turn = [*range(rooms)]
        turn[a], turn[b] = b, a
        swaps.append(turn)
    later = np.arange(rooms) >= np.arange(first)[:, None]
    tails = np.concatenate([later * shift for shift in range(1, robots)] or [later[:0] * 1])
    return np.array(swaps, dtype=np.int64).reshape(-1, rooms), tails
