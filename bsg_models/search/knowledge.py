"""Define what robots know, the only input of a planner, and the cheapest ways between rooms."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
import numpy.typing as npt
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from bsg_data.arrays import Bools, Floats, Ints

Task = Literal["single", "all"]


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What E robots know during their searches of one building.

    Attributes:
        task: whether one instance of each class is enough, or all must be found.
        here: `[E]` node of the robot.
        travel: of all searches of the building.
        rows: `[E]` indices of these searches in `travel`.
        unexplored: `[E, N]` rooms that the robot can reach and has not entered.
        wanted: `[E, A]` classes still to be found.
        presence: `[E, N, A]` believed P(at least one instance), of unexplored rooms only.
        share: `[E, N, A]` believed E″(α), the class's share of the room's objects; None for a
            planner that does not read it, and if the caller of `next_room` gave none.
        tour: `[E, N]` positions of the rooms in the oracle's tour; None for other planners.
    """

    task: Task
    here: Ints
    travel: Travel
    rows: Ints
    unexplored: Bools
    wanted: Bools
    presence: Floats
    share: Floats | None
    tour: Ints | None = None

    def take(self, which: Ints | Bools) -> Knowledge:
        """Return what some of the robots know."""
        arrays = {
            name: value[which]
            for name in ("here", "rows", "unexplored", "wanted", "presence", "share", "tour")
            if (value := getattr(self, name)) is not None
        }
        return replace(self, **arrays)

    @property
    def distance(self) -> Floats:
        """Cost of going to each node, `[E, N]`."""
        return np.asarray(self.travel.costs[self.rows, self.here])

    @property
    def costs(self) -> Floats:
        """Cost of the cheapest way between any two nodes, `[E, N, N]`."""
        return np.asarray(self.travel.costs[self.rows])

    @property
    def any_presence(self) -> Floats:
        """P(at least one instance of any class that is still to be found), `[E, N]`."""
        return np.asarray(1 - np.where(self.wanted[:, None], 1 - self.presence, 1.0).prod(axis=2))

    @property
    def left(self) -> Floats:
        """P(at least one instance in the unexplored rooms), rooms being independent, `[E]`."""
        return np.asarray(1 - np.where(self.unexplored, 1 - self.any_presence, 1.0).prod(axis=1))


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
