"""Choose the room to go to: a planner's next room, or a likelier one behind it."""

from __future__ import annotations

import math

from bsg_data.arrays import Bools, Floats
from bsg_models.robot.ways import Ways
from bsg_models.search.catalogue import AnyPlanner
from bsg_models.search.knowledge import Task
from bsg_models.search.planners import next_room


def choose_destination(
    ways: Ways,
    *,
    here: int,
    explored: Bools,
    presence: Floats,
    planner: AnyPlanner = "expected-cost",
    task: Task = "single",
) -> int | None:
    """Return the room to go to.

    A planner first names a room that costs nothing to look into, however unlikely: a hall on the
    way to the kitchen, or the robot's own room. A robot needs the destination instead. So a room is
    skipped for the planner's next one if that is likelier and lies behind it on the cheapest way.

    Args:
        ways: between N nodes.
        here: node of the robot.
        explored: `[N]` rooms that need not be looked into.
        presence: `[N, A]` P(at least one is there) of the things that are looked for.
        planner: as for `next_room`.
        task: as for `next_room`.

    Returns:
        A room, which may be `here`; None if no room can be reached.

    Raises:
        RecipeError: as `next_room`.
    """
    likely = 1 - (1 - presence).prod(axis=1)
    known = explored.copy()
    place, chosen = here, None
    while True:
        beyond = next_room(
            ways.edges, here=place, explored=known, presence=presence, task=task, planner=planner
        )
        if beyond is None:
            return chosen
        if chosen is not None:
            by_way_of = ways.costs[here, chosen] + ways.costs[chosen, beyond]
            on_the_way = math.isclose(by_way_of, ways.costs[here, beyond])
            if not on_the_way or likely[beyond] <= likely[chosen]:
                return chosen
        place = chosen = beyond
        known[beyond] = True
