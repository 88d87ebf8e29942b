"""Count the rooms of a building that a robot has not found yet, and add them to its graph."""

from __future__ import annotations

from bsg_data.observation.partial_graph import KnownRoom, PartialGraph
from bsg_data.observation.reports import discover

EXPLORE = "explore"  # what `next_room` answers: look for rooms that are not found yet
# Buildings of HM3D's train split (145) by their number of rooms, from 0 on.
# fmt: off
_BUILDINGS = (
    0, 0, 0, 0, 2, 0, 4, 2, 10, 11, 6, 14, 14, 16, 11, 9, 6, 4, 5, 7, 2, 5, 2, 4, 2, 2, 2, 2, 1, 0,
    1, 0, 1,
)
# fmt: on


def count_unfound(graph: PartialGraph) -> int:
    """Return how many rooms are not found yet.

    If the graph says only that there are more, it is the mean of the homes that have more rooms
    than were found, and at least 1.
    """
    if graph.more_rooms is not True:
        return graph.more_rooms or 0
    found = len(graph.rooms)
    larger = [(rooms - found, homes) for rooms, homes in enumerate(_BUILDINGS) if rooms > found]
    homes = sum(number for _, number in larger)
    return max(1, round(sum(more * number for more, number in larger) / homes)) if homes else 1


def add_unfound(graph: PartialGraph) -> PartialGraph:
    """Return the graph with the rooms that are not found yet, last, of which nothing is known."""
    for number in range(1, count_unfound(graph) + 1):
        unknown = KnownRoom(f"(not found yet: {number})", 1.0, visited=False)
        graph = discover(graph, unknown)
    return graph
