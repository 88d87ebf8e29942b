"""List the edges of a graph: building and rooms, connected rooms, or all pairs of rooms."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from functools import lru_cache
from typing import Literal

import numpy as np

from bsg_data.arrays import Ints
from bsg_data.observation.observation import Observation
from bsg_models.errors import PredictionError

MOST_PAIRS = 16_000_000  # of rooms in one call of a network: 4,000 rooms of one building
MOST_BYTES = 512 * 2**20  # that a network computes for all edges at once, several times over
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

    Raises:
        PredictionError: if there are too many of them.
    """
    if "complete" in edges:
        require_pairs(int((np.diff(seen.starts) ** 2).sum()))
    parts = []
    for number, first in enumerate(seen.starts[:-1].tolist()):
        nodes = int(seen.starts[number + 1]) - first
        pairs: tuple[tuple[int, int], ...] = ()
        if "adjacent" in edges:
            own = seen.connections_of(number).pairs.tolist()
            pairs = tuple((a, b) for a, b in own)
        parts.append(first + _connect_once(nodes, tuple(edges), pairs))
    return np.concatenate([np.zeros((2, 0), dtype=np.int64), *parts], axis=1)


def require_pairs(pairs: int) -> None:
    """Refuse more pairs of rooms than fit into memory, before it is allocated.

    Raises:
        PredictionError: naming models that take any number of rooms.
    """
    if pairs > MOST_PAIRS:
        raise PredictionError(
            f"a model that uses every pair of rooms takes at most {MOST_PAIRS:,} pairs at "
            f"once; found {pairs:,}. Use `universal` or `ceci-sage`, which take any number of rooms"
        )


def count_edges(seen: Observation, edges: Sequence[EdgeSet]) -> Ints:
    """Return the largest possible number of directed edges of each building, `[B]`."""
    rooms = np.diff(seen.starts) - 1
    number = rooms * (("up" in edges) + ("down" in edges))
    if "complete" in edges:
        number = number + rooms * (rooms - 1)
    if "adjacent" in edges:
        of_pairs = seen.building[seen.connections.pairs[:, 0]]
        number = number + 2 * np.bincount(of_pairs, minlength=len(seen))
    return number


def split_within(
    seen: Observation, number: Ints, *, bytes_each: int, model: str, filled: bool = False
) -> Iterator[Observation]:
    """Yield the buildings of an observation in their order, in groups that fit into memory.

    Args:
        seen: of one building or more.
        number: `[B]` of the pairs of nodes that a model uses in each.
        bytes_each: memory per pair.
        model: its name, for the error.
        filled: whether it pads all buildings to the largest.

    Raises:
        PredictionError: if one building is too large, before its pairs are listed.
    """
    most = min(MOST_BYTES // bytes_each, MOST_PAIRS)
    largest = int(number.argmax())
    if number[largest] > most:
        rooms = int(seen.starts[largest + 1] - seen.starts[largest]) - 1
        raise PredictionError(
            f"{model}: uses {number[largest]:,} pairs of rooms in a building of {rooms:,} "
            f"rooms; its memory limit is {most:,} pairs at once. Use `universal` or "
            "`ceci-sage`, which take any number of rooms"
        )
    first = total = widest = 0
    for last, pairs in enumerate(number.tolist()):
        total, widest = total + pairs, max(widest, pairs)
        if (widest * (last + 1 - first) if filled else total) > most:
            yield seen.take(range(first, last))
            first, total, widest = last, pairs, pairs
    yield seen if not first else seen.take(range(first, len(seen)))


@lru_cache(maxsize=4096)
def _connect_once(
    nodes: int, edges: tuple[EdgeSet, ...], adjacent: tuple[tuple[int, int], ...]
) -> Ints:
    return connect(nodes, edges, adjacent=adjacent)
