"""What robots know in the middle of their searches: all that a planner is given."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from bsg_models.search.shortest_paths import Bools, Floats, Ints, Travel

Task = Literal["single", "all"]


@dataclass(frozen=True, eq=False)
class Knowledge:
    """What E robots know in the middle of their searches of one building.

    Attributes:
        task: whether one instance of each class is enough, or all are to be found.
        here: `[E]` node of the robot.
        travel: of all searches of the building.
        rows: `[E]` which of them these are.
        unexplored: `[E, N]` rooms that it can reach and has not entered.
        wanted: `[E, A]` classes still to be found.
        presence: `[E, N, A]` believed P(at least one instance); of unexplored rooms alone.
        share: `[E, N, A]` believed E″(α), the class's share of the room's objects; None for a
            planner that does not look at it, and if a robot of its own was not given it.
        lots: `[E, N]` random numbers, for a planner that draws lots.
        tour: `[E, N]` places of the rooms in the oracle's tour; nobody else is given one.
    """

    task: Task
    here: Ints
    travel: Travel
    rows: Ints
    unexplored: Bools
    wanted: Bools
    presence: Floats
    share: Floats | None
    lots: Floats
    tour: Ints | None = None

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
