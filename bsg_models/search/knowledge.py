"""Define what robots know during their searches: the only input of a planner."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.search.shortest_paths import Travel

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
