"""Define what robots know, the only input of a planner, and the cheapest ways between rooms."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.errors import RecipeError

Task = Literal["single", "all"]
MOST_JOINED = 1_400  # nodes that are gone by one after the other: it takes the cube
_MANY = 8  # if every node left has one in so many as neighbours, going by all of them is faster


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What E robots know during their searches of one building.

    Attributes:
        task: whether one instance of each class is enough, or all must be found.
        here: `[E]` node of the robot.
        ways: `[S, N, N]` costs of the cheapest ways, in all S searches of the building.
        rows: `[E]` indices of these searches in `ways`.
        unexplored: `[E, N]` rooms that the robot can reach and has not entered.
        wanted: `[E, A]` classes still to be found.
        presence: `[E, N, A]` believed P(a look finds at least one instance), of unexplored rooms
            only. A look that misses nothing finds one if there is one.
        again: `[E, L, N, A]` believed P(the next look finds none, and the one after it does), and
            so on for L looks; None if looks miss nothing.
        share: `[E, N, A]` believed E″(α), the class's share of the room's objects; None if the
            caller of `next_room` gave none.
        tour: `[E, N]` positions of the rooms in the oracle's tour; None for other planners.
        look: `[E, N]` cost of a look in each room, in the unit of the ways; None if it is nothing.
    """

    task: Task
    here: Ints
    ways: Floats
    rows: Ints
    unexplored: Bools
    wanted: Bools
    presence: Floats
    share: Floats | None
    tour: Ints | None = None
    look: Floats | None = None
    again: Floats | None = None

    @property
    def distance(self) -> Floats:
        """Cost of going to each node, `[E, N]`."""
        return np.asarray(self.ways[self.rows, self.here])

    @property
    def any_presence(self) -> Floats:
        """P(at least one instance of any class that is still to be found), `[E, N]`."""
        return np.asarray(1 - np.where(self.wanted[:, None], 1 - self.presence, 1.0).prod(axis=2))


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
    """Return the cheapest ways over edges `[E, N, N]`: costs ≥ 0 from row to column, ∞ for none.

    This is the method of Floyd and Warshall, in all graphs at once: its time depends only on E, N.
    """
    travel = go_straight(edges)
    for k in range(edges.shape[1]):
        through = travel.costs[:, :, k, None] + travel.costs[:, None, k]
        better = through < travel.costs
        np.copyto(travel.costs, through, where=better)
        np.copyto(travel.steps, travel.steps[:, :, k, None], where=better)
    return travel


def find_costs(edges: Floats) -> Floats:
    """Return the costs of the cheapest ways in one graph, over edges `[N, N]` as of `find_ways`.

    Nodes are taken out, those with the fewest neighbours first. The ways through a node become
    edges between its neighbours. Then the nodes come back, the last one first, and reach all others
    through those neighbours. So a large graph in which few rooms connect takes about N², not N³.

    Raises:
        RecipeError: if so many connect that it takes N³, and there are more than `MOST_JOINED`.
    """
    nodes, joined = len(edges), np.isfinite(edges) | np.isfinite(edges.T)
    np.fill_diagonal(joined, False)
    degrees = joined.sum(axis=1)
    left, order, ends = edges.astype(np.float64), [], []
    for _ in range(nodes):
        node = int(degrees.argmin())
        near = np.flatnonzero(joined[node])
        if len(near) * _MANY > nodes:
            return _find_by_all(edges)
        out, back = left[node, near], left[near, node]
        order.append(node)
        ends.append((near, np.stack([out, back])))
        joined[near, node], degrees[node] = False, 2 * nodes  # it is not taken out again
        block = np.ix_(near, near)
        left[block] = np.minimum(left[block], back[:, None] + out)
        degrees[near] += (~joined[block]).sum(axis=1) - 2  # without itself and the node
        joined[block] = True
        joined[near, near] = False
    place = nodes - 1 - np.argsort(order)  # the last one is the first that comes back
    both = np.zeros((2, nodes, nodes))  # to the other nodes, and back
    for k, (near, two) in enumerate(reversed(ends)):
        through = both[:, place[near], :k] + two[:, :, None]
        both[:, k, :k] = through.min(axis=1, initial=np.inf)
        both[:, :k, k] = both[::-1, k, :k]
    return np.asarray(both[0][np.ix_(place, place)])


def _find_by_all(edges: Floats) -> Floats:
    """Return what `find_costs` does, by the method of Floyd and Warshall."""
    if len(edges) - 1 > MOST_JOINED:
        raise RecipeError(
            f"expected at most {MOST_JOINED:,} rooms to measure ways between where each connects "
            f"with many, found {len(edges) - 1:,}; ask without the robot's room, or about a part "
            "of the building",
            code="rooms-too-many",
        )
    costs = edges.astype(np.float64)
    np.fill_diagonal(costs, 0.0)
    for k in range(len(costs)):
        np.minimum(costs, costs[:, k, None] + costs[k], out=costs)
    return costs


def go_straight(edges: Floats) -> Travel:
    """Return travel along single edges `[E, N, N]`, even if a detour is cheaper."""
    costs = edges.astype(np.float64)
    every = np.arange(costs.shape[1])
    costs[:, every, every] = 0.0
    end, here = every.astype(np.int16), every[:, None].astype(np.int16)
    return Travel(costs, np.where(np.isfinite(costs), end, here))
