"""What a robot learns, one thing after another: an object, that it is in a room, a new room.

Each function returns a new partial graph and leaves the old one as it was. `observe` replaces all
that is known of a room at once.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import VAGUE, ShareBelief
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject, hide_of_room

GLIMPSED_SHARE = 0.84  # of a room into which it looked from outside: the middle of mask `explore`


def see_object(graph: PartialGraph, seen: SeenObject) -> PartialGraph:
    """Return what a robot knows once it has seen one object.

    An object that is known by this name is where it is seen now. A room that counted as not looked
    into counts as glimpsed; otherwise its hidden share stays what it was, for the robot may have
    looked at more without seeing anything.

    Raises:
        RecipeError: if there is no such room.
    """
    if not 0 <= seen.room_index <= len(graph.rooms):
        raise RecipeError(f"{graph.scene_id}: room {seen.room_index} of 0..{len(graph.rooms)}")
    others = tuple(obj for obj in graph.objects if obj.name != seen.name)
    graph = replace(graph, objects=(*others, seen))
    if not seen.room_index or graph.rooms[seen.room_index - 1].hidden_share < 1:
        return graph
    return hide_of_room(graph, seen.room_index, ShareBelief(GLIMPSED_SHARE))


def enter(
    graph: PartialGraph, room_index: int, *, hidden_share: ShareBelief | None = None
) -> PartialGraph:
    """Return what a robot knows once it is in a room, or has seen more of it.

    Args:
        graph: what it knew.
        room_index: the room, 1..R.
        hidden_share: of its objects, how many it has not seen by now, 0 once the room is searched;
            None for what was known, or for anything (`VAGUE`) in a room of which less was seen than
            one sees from inside.

    Raises:
        RecipeError: if there is no such room.
    """
    if not 1 <= room_index <= len(graph.rooms):
        raise RecipeError(f"{graph.scene_id}: room {room_index} of 1..{len(graph.rooms)}")
    known = graph.rooms[room_index - 1]
    was_inside = known.visited and known.hidden_share < 1
    usual = known.share if was_inside or known.hidden_share <= VAGUE.mean else VAGUE
    share = usual if hidden_share is None else hidden_share
    rooms = list(graph.rooms)
    rooms[room_index - 1] = replace(known, visited=True)
    return hide_of_room(replace(graph, rooms=tuple(rooms)), room_index, share)


def discover(graph: PartialGraph, room: KnownRoom, *, beside: Collection[int] = ()) -> PartialGraph:
    """Return what a robot knows once it has learned that there is one more room.

    Args:
        graph: what it knew.
        room: the new one; it gets the last index.
        beside: indices of rooms that it connects with.

    Raises:
        RecipeError: if a room of this name is known already, or one beside it is not.
    """
    number = len(graph.rooms) + 1
    if room.name in {known.name for known in graph.rooms}:
        raise RecipeError(f"{graph.scene_id}: room {room.name!r} is known already")
    if not all(1 <= other < number for other in beside):
        raise RecipeError(f"{graph.scene_id}: beside {sorted(beside)}: rooms are 1..{number - 1}")
    pairs = {*graph.adjacency, *((other, number) for other in beside)}
    return replace(
        graph,
        rooms=(*graph.rooms, room),
        adjacency=tuple(sorted(pairs)),
        hidden_share=(graph.hidden_share * (number - 1) + room.hidden_share) / number,
    )
