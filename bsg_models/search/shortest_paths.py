"""Find the cheapest way between any two nodes of many room graphs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]
_TOGETHER = 128  # nodes; larger graphs are processed one by one, over their edges only


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

    def take(self, rows: Ints) -> Travel:
        """Return the travel of some graphs."""
        return Travel(self.costs[rows], self.steps[rows])


def find_ways(edges: Floats) -> Travel:
    """Return the cheapest ways, by Floyd and Warshall for all graphs at once if they are small.

    Args:
        edges: `[E, N, N]` costs ≥ 0 from row to column; ∞ without an edge.
    """
    nodes = edges.shape[1]
    if nodes > _TOGETHER:
        return _find_ways_one_by_one(edges)
    costs = edges.astype(np.float64)
    every = np.arange(nodes)
    costs[:, every, every] = 0.0
    steps = np.where(np.isfinite(costs), every[None, None], every[None, :, None]).astype(np.int16)
    for k in range(nodes):
        through = costs[:, :, k, None] + costs[:, None, k]
        better = through < costs
        costs = np.where(better, through, costs)
        steps = np.where(better, steps[:, :, k, None], steps)
    return Travel(costs, steps)


def _find_ways_one_by_one(edges: Floats) -> Travel:
    """Return the cheapest ways, one graph at a time; sums may differ in the last bits."""
    nodes = edges.shape[1]
    costs, steps = np.empty(edges.shape), np.empty(edges.shape, dtype=np.int16)
    every = np.arange(nodes)
    for number, one in enumerate(edges):
        source, target = np.nonzero(np.isfinite(one))  # an edge may cost 0
        # Backwards, the node before the last is the one after the first.
        backwards = csr_array((one[source, target], (target, source)), shape=one.shape)
        found, before = shortest_path(backwards, return_predecessors=True)
        costs[number] = found.T
        steps[number] = np.where(before.T < 0, every[:, None], before.T)
    return Travel(costs, steps)


def go_straight(edges: Floats) -> Travel:
    """Return travel along single edges `[E, N, N]`, even if a detour is cheaper."""
    costs = edges.astype(np.float64)
    every = np.arange(costs.shape[1])
    costs[:, every, every] = 0.0
    there, here = every.astype(np.int16), every[:, None].astype(np.int16)
    return Travel(costs, np.where(np.isfinite(costs), there, here))
