"""Set the hidden shares of a robot's graph to what a person says."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.partial_graph import PartialGraph, hide_of_room
from bsg_data.recipes import read_number
from bsg_data.spelling import show_value
from bsg_models.robot.room_names import find_room

_NONE: Mapping[str, float] = MappingProxyType({})


def tell_shares(
    graph: PartialGraph, *, every: float | None = None, rooms: Mapping[str, float] = _NONE
) -> PartialGraph:
    """Return a graph with the given hidden shares; the building's share follows from its rooms'.

    A share of 1 marks the room as not entered, and 0 as searched. In between, the visits stay as
    the graph has them.

    Args:
        graph: with shares of its own.
        every: share of all rooms that `rooms` does not name; of the building, if it has no rooms.
        rooms: shares by room id or label.

    Raises:
        RecipeError: if a share is not 0 to 1, or a name means no room or several.
    """
    if not isinstance(rooms, Mapping):
        raise RecipeError(
            f"{graph.scene_id}: hidden shares: expected a mapping of rooms to shares, found "
            f"{show_value(rooms)}"
        )
    if every is not None:
        every = _read_share(graph, "every room", every)
    told: dict[int, float | None] = dict.fromkeys(range(1, len(graph.rooms) + 1), every)
    for name, said in rooms.items():
        index = find_room(graph, name)
        told[index] = None if said is None else _read_share(graph, name, said)
    if not graph.rooms and every is not None:
        return replace(graph, hidden_share=every)
    for index, share in told.items():
        if share is not None:
            graph = _hide(graph, index, share)
    return graph


def _read_share(graph: PartialGraph, name: str, share: object) -> float:
    return read_number(f"{graph.scene_id}: hidden share of {name}", share, most=1.0)


def _hide(graph: PartialGraph, index: int, share: float) -> PartialGraph:
    rooms = list(graph.rooms)
    visited = share < 1 and (share == 0 or rooms[index - 1].visited)
    rooms[index - 1] = replace(rooms[index - 1], visited=visited)
    return hide_of_room(replace(graph, rooms=tuple(rooms)), index, ShareBelief(share))
