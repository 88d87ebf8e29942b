"""Find the cheapest way between any two nodes of many room graphs."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from bsg_data.arrays import Bools, Floats, Ints

_TOGETHER = 30  # nodes; with more, one graph at a time is faster


@dataclass(frozen=True, eq=False)
class Travel:
    """Ways between the nodes of E graphs of N nodes.

    Attributes:
        costs: `[E, N, N]` of the cheapest way; 0 to itself, ∞ if there is none.
        steps: `[E, N, N]` second node on that way; the node itself if there is none.
    """

    costs: Floats
    steps: npt.NDArray[np.int16]

    def first_on_the_way(self, rows: Ints, here: Ints, target: Ints, wanted: Bools) -> Ints:
        """Return the first wanted node on some ways, the target at the latest, `[M]`.

        Args:
            rows: `[M]` graphs.
            here: `[M]` starts of the ways, which do not count.
            target: `[M]` ends of the ways.
            wanted: `[M, N]`.
        """
        every = np.arange(len(rows))
        place = self.steps[rows, here, target].astype(np.int64)
        while True:
            going = ~wanted[every, place] & (place != target)
            if not going.any():
                return place
            place = np.where(going, self.steps[rows, place, target], place)


def find_ways(edges: Floats) -> Travel:
    """Return the cheapest ways over edges `[E, N, N]`: costs ≥ 0 from row to column, ∞ for none."""
    return _search_together(edges) if edges.shape[1] <= _TOGETHER else _search_each(edges)


def _search_together(edges: Floats) -> Travel:
    """Return the cheapest ways in many small graphs at once, by Floyd and Warshall."""
    straight = go_straight(edges)
    costs, steps = straight.costs, straight.steps
    for k in range(edges.shape[1]):
        through = costs[:, :, k, None] + costs[:, None, k]
        better = through < costs
        costs = np.where(better, through, costs)
        steps = np.where(better, steps[:, :, k, None], steps)
    return Travel(costs, steps)


def _search_each(edges: Floats) -> Travel:
    """Return the cheapest ways in large graphs one by one, over their edges only."""
    costs, steps = np.empty(edges.shape), np.empty(edges.shape, dtype=np.int16)
    itself = np.arange(edges.shape[1])[:, None]
    for number, one in enumerate(edges):
        source, target = np.nonzero(np.isfinite(one))  # an edge may cost 0
        # Backwards, the node before the last is the one after the first.
        backwards = csr_array((one[source, target], (target, source)), shape=one.shape)
        found, before = shortest_path(backwards, return_predecessors=True)
        costs[number] = found.T
        steps[number] = np.where(before.T < 0, itself, before.T)
    return Travel(costs, steps)


def go_straight(edges: Floats) -> Travel:
    """Return travel along single edges `[E, N, N]`, even if a detour is cheaper."""
    costs = edges.astype(np.float64)
    every = np.arange(costs.shape[1])
    costs[:, every, every] = 0.0
    there, here = every.astype(np.int16), every[:, None].astype(np.int16)
    return Travel(costs, np.where(np.isfinite(costs), there, here))
