"""Update a partial graph step by step: an object is seen, a room is entered, a room is found.

Each function returns a new partial graph and leaves the old one unchanged. `observe` replaces all
that is known of a room at once.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import VAGUE, ShareBelief
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject, hide_of_room

GLIMPSED_SHARE = 0.84  # of a room seen only from outside: the middle value of the mask `explore`


def see_object(graph: PartialGraph, seen: SeenObject) -> PartialGraph:
    """Return the partial graph after the robot has seen one object.

    A known object of this name moves to the new place. A room of which nothing was seen becomes
    glimpsed. The hidden share of any other room stays the same, because one object does not say how
    much more the robot looked at.

    Raises:
        RecipeError: if the room does not exist.
    """
    if not 0 <= seen.room_index <= len(graph.rooms):
        raise RecipeError(
            f"{graph.scene_id}: expected a room of 0..{len(graph.rooms)}, found room "
            f"{seen.room_index}"
        )
    others = tuple(obj for obj in graph.objects if obj.name != seen.name)
    graph = replace(graph, objects=(*others, seen))
    if not seen.room_index or graph.rooms[seen.room_index - 1].hidden_share < 1:
        return graph
    return hide_of_room(graph, seen.room_index, ShareBelief(GLIMPSED_SHARE))


def enter(
    graph: PartialGraph, room_index: int, *, hidden_share: ShareBelief | None = None
) -> PartialGraph:
    """Return the partial graph after the robot has entered a room or seen more of it.

    Args:
        graph: the partial graph before.
        room_index: the room, 1..R.
        hidden_share: new hidden share of the room, 0 after a search. None keeps the known share,
            but a room not yet visited with a share above 0.5 gets `VAGUE`.

    Raises:
        RecipeError: if the room does not exist.
    """
    if not 1 <= room_index <= len(graph.rooms):
        raise RecipeError(
            f"{graph.scene_id}: expected a room of 1..{len(graph.rooms)}, found room {room_index}"
        )
    known = graph.rooms[room_index - 1]
    was_inside = known.visited and known.hidden_share < 1
    usual = known.share if was_inside or known.hidden_share <= VAGUE.mean else VAGUE
    share = usual if hidden_share is None else hidden_share
    rooms = list(graph.rooms)
    rooms[room_index - 1] = replace(known, visited=True)
    return hide_of_room(replace(graph, rooms=tuple(rooms)), room_index, share)


def discover(graph: PartialGraph, room: KnownRoom, *, beside: Collection[int] = ()) -> PartialGraph:
    """Return the partial graph with one more room.

    Args:
        graph: the partial graph before.
        room: the new room; it gets the last index.
        beside: indices of connected rooms.

    Raises:
        RecipeError: if the name is known already, or a connected room does not exist.
    """
    number = len(graph.rooms) + 1
    if room.name in {known.name for known in graph.rooms}:
        raise RecipeError(f"{graph.scene_id}: room {room.name!r} is known already")
    if not all(1 <= other < number for other in beside):
        raise RecipeError(
            f"{graph.scene_id}: beside: expected rooms of 1..{number - 1}, found {sorted(beside)}"
        )
    pairs = {*graph.adjacency, *((other, number) for other in beside)}
    return replace(
        graph,
        rooms=(*graph.rooms, room),
        adjacency=tuple(sorted(pairs)),
        hidden_share=(graph.hidden_share * (number - 1) + room.hidden_share) / number,
    )
