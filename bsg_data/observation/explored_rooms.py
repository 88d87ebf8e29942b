"""Sample which rooms a robot explores, in which order, and which others it glimpses.

The masks use these functions (`bsg_data.observation.masks`). Rooms are counted from 0 here.
"""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.recipes import Exploration
from bsg_data.scene.connections import Connections


def divide_share(hidden: float, shown: float, *, alone: float) -> float:
    """Return hidden / (hidden + shown), or `alone` where there is neither."""
    return hidden / (hidden + shown) if hidden + shown else alone


def walk(
    number: int,
    entered: int,
    plan: Exploration,
    connections: Connections,
    rng: np.random.Generator,
) -> Ints:
    """Return the rooms from 0, those that are entered first, in the order of entering them.

    Over connections the robot starts in a random room and goes on in a random one beside those that
    it was in; where a connected part is exhausted, in any other. Where nothing is known, every room
    neighbours every other.
    """
    if not (plan.connected and len(connections)):
        return rng.permutation(number)
    neighbours = _neighbours(number, connections)
    inside, frontier = np.zeros(number, dtype=bool), np.zeros(number, dtype=bool)
    order = []
    for _ in range(entered):
        reachable = frontier & ~inside
        room = int(rng.choice(np.flatnonzero(reachable if reachable.any() else ~inside)))
        inside[room] = True
        frontier |= neighbours[room]
        order.append(room)
    return np.concatenate([np.array(order, dtype=np.int64), np.flatnonzero(~inside)])


def find_beside(inside: Ints, outside: Ints, number: int, connections: Connections) -> Ints:
    """Return the rooms outside that a door joins to one inside; all of them if none is known."""
    if not (len(inside) and len(connections)):
        return outside if len(inside) else outside[:0]
    reachable: Bools = np.asarray(_neighbours(number, connections)[inside].any(axis=0))
    return outside[reachable[outside]]


def glimpse(
    near: Ints, plan: Exploration, limit: float, rng: np.random.Generator
) -> tuple[Ints, Floats]:
    """Sample which rooms are glimpsed and what they hide; they show `limit` in all at most."""
    chosen = rng.permutation(near)[rng.random(len(near)) < plan.glimpsed]
    hide = _as_told(rng.uniform(*plan.glimpsed_share, size=len(chosen)))
    within = np.cumsum(1 - hide) <= limit
    return chosen[within], hide[within]


def spread_shares(mean: float, number: int, plan: Exploration, rng: np.random.Generator) -> Floats:
    """Sample shares uniformly around a mean, as far from it as the plan says."""
    width = plan.spread * max(min(mean, 1 - mean), 0.0)
    if not width:
        return np.full(number, min(mean, 1.0))
    return _as_told(rng.uniform(mean - width, mean + width, size=number))


def _as_told(shares: Floats) -> Floats:
    """Return shares in the precision that they are told in: none that is less is told as 1."""
    return shares.astype(np.float32).astype(np.float64)


def _neighbours(number: int, connections: Connections) -> Bools:
    """Return which rooms connect, `[R, R]`, from 0."""
    matrix = np.zeros((number, number), dtype=bool)
    left, right = connections.pairs.T - 1
    matrix[left, right] = matrix[right, left] = True
    return matrix
