"""List the edges of a graph: building and rooms, connected rooms, or all pairs of rooms."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from bsg_data.arrays import Ints
from bsg_data.observation.observation import Observation

EdgeSet = Literal["up", "down", "adjacent", "complete"]


def connect(
    nodes: int, edges: Sequence[EdgeSet], *, adjacent: Iterable[tuple[int, int]] = ()
) -> Ints:
    """Return directed edges `[2, E]` among a building (0) and its rooms, sorted.

    Args:
        nodes: N = 1 + R.
        edges: `up` rooms → building, `down` building → rooms, `adjacent` both directions between
            rooms that are known to connect, `complete` both directions between all rooms.
        adjacent: pairs of rooms.

    >>> connect(3, ["up"]).tolist()
    [[1, 2], [0, 0]]
    """
    rooms = np.arange(1, nodes)
    building = np.zeros_like(rooms)
    parts = [np.zeros((2, 0), dtype=np.int64)]
    if "up" in edges:
        parts.append(np.stack([rooms, building]))
    if "down" in edges:
        parts.append(np.stack([building, rooms]))
    if "adjacent" in edges:
        pairs = np.array(list(adjacent), dtype=np.int64).reshape(-1, 2).T
        parts += [pairs, pairs[::-1]]
    if "complete" in edges:
        every = np.stack([rooms.repeat(len(rooms)), np.tile(rooms, len(rooms))])
        parts.append(every[:, every[0] != every[1]])
    source, target = np.concatenate(parts, axis=1)
    numbers = np.sort(source * nodes + target, kind="stable")  # fast, as they are nearly sorted
    kept = np.diff(numbers, prepend=-1) > 0
    return np.stack(np.divmod(numbers[kept], nodes))


def edges_of(seen: Observation, edges: Sequence[EdgeSet]) -> Ints:
    """Return the directed edges of all buildings of an observation by row, `[2, E]`.

    Edges are grouped by building, in the order of the buildings, and sorted within each.
    """
    parts = []
    for number, first in enumerate(seen.starts[:-1].tolist()):
        nodes = int(seen.starts[number + 1]) - first
        pairs: tuple[tuple[int, int], ...] = ()
        if "adjacent" in edges:
            own = seen.connections_of(number).pairs.tolist()
            pairs = tuple((a, b) for a, b in own)
        parts.append(first + _connect_once(nodes, tuple(edges), pairs))
    return np.concatenate([np.zeros((2, 0), dtype=np.int64), *parts], axis=1)


@lru_cache(maxsize=4096)
def _connect_once(
    nodes: int, edges: tuple[EdgeSet, ...], adjacent: tuple[tuple[int, int], ...]
) -> Ints:
    return connect(nodes, edges, adjacent=adjacent)
