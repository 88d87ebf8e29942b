"""Travel: the cheapest way between any two nodes of many room graphs at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Bools = npt.NDArray[np.bool_]


@dataclass(frozen=True, eq=False)
class Travel:
    """Ways between the nodes of E graphs of N nodes.

    Attributes:
        costs: `[E, N, N]` of the cheapest way; 0 to itself, ∞ where there is none.
        steps: `[E, N, N]` node after the first on that way; itself where there is none.
    """

    costs: Floats
    steps: npt.NDArray[np.int16]

    def first_on_the_way(self, rows: Ints, here: Ints, target: Ints, wanted: Bools) -> Ints:
        """Return the first wanted node on some ways, the target at the latest, `[M]`.

        Args:
            rows: `[M]` graphs.
            here: `[M]` where the ways begin; not looked at.
            target: `[M]` where they end.
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
    """Return the cheapest ways by Floyd and Warshall, all graphs at once.

    Args:
        edges: `[E, N, N]` costs ≥ 0 from row to column; ∞ where there is no edge.
    """
    costs = edges.astype(np.float64)
    nodes = costs.shape[1]
    every = np.arange(nodes)
    costs[:, every, every] = 0.0
    steps = np.where(np.isfinite(costs), every[None, None], every[None, :, None]).astype(np.int16)
    for k in range(nodes):
        through = costs[:, :, k, None] + costs[:, None, k]
        better = through < costs
        costs = np.where(better, through, costs)
        steps = np.where(better, steps[:, :, k, None], steps)
    return Travel(costs, steps)


def go_straight(edges: Floats) -> Travel:
    """Return travel along single edges `[E, N, N]`, even where a detour is cheaper."""
    costs = edges.astype(np.float64)
    every = np.arange(costs.shape[1])
    costs[:, every, every] = 0.0
    steps = np.where(np.isfinite(costs), every[None, None], every[None, :, None])
    return Travel(costs, steps.astype(np.int16))
