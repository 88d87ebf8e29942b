"""List the edges of graphs: building and rooms, connected rooms, or all pairs of rooms."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np

from bsg_data.arrays import Ints
from bsg_data.observation.observation import Observation

# `up` from rooms to the building, `down` from it to rooms, both ways between rooms that are known
# to connect (`adjacent`), or between all rooms of a building (`complete`).
EdgeSet = Literal["up", "down", "adjacent", "complete"]


def list_edges(seen: Observation, edges: Sequence[EdgeSet]) -> Ints:
    """Return the directed edges of all buildings by row, `[2, E]`, sorted and each once."""
    rooms, nodes = np.flatnonzero(~seen.is_building), len(seen.inputs)
    buildings = seen.starts[seen.building[rooms]]
    parts = [np.zeros((2, 0), dtype=np.int64)]
    if "up" in edges:
        parts.append(np.stack([rooms, buildings]))
    if "down" in edges:
        parts.append(np.stack([buildings, rooms]))
    if "adjacent" in edges:
        pairs = seen.connections.pairs.T
        parts += [pairs, pairs[::-1]]
    if "complete" in edges:
        others, starts = seen.rows_of(seen.building[rooms])
        every = np.stack([rooms.repeat(np.diff(starts)), others])
        parts.append(every[:, (every[0] != others) & ~seen.is_building[others]])
    source, target = np.concatenate(parts, axis=1)
    numbers = np.sort(source * nodes + target, kind="stable")  # fast, as they are nearly sorted
    kept = np.diff(numbers, prepend=-1) > 0
    return np.stack(np.divmod(numbers[kept], nodes))
