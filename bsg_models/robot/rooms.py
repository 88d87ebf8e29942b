"""Find the room that a name means, by id or by label, and set what a person says of its share."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from types import MappingProxyType

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.partial_graph import PartialGraph, hide_of_room
from bsg_data.scene.class_map import normalise_name
from bsg_data.spelling import SHOWN, ask_if_meant

_LISTED = 8  # rooms listed in an error
_NONE: Mapping[str, float] = MappingProxyType({})


def find_room(graph: PartialGraph, name: str) -> int:
    """Return the index, 1..R, of the room with this id, or with a label that it alone has."""
    ids = [room.name for room in graph.rooms]
    if name in ids:
        return ids.index(name) + 1
    said = normalise_name(str(name))
    labelled = [
        number
        for number, room in enumerate(graph.rooms, 1)
        if said and said in (normalise_name(room.label or ""), normalise_name(room.name))
    ]
    if len(labelled) == 1:
        return labelled[0]
    if labelled:
        those = ", ".join(ids[number - 1] for number in labelled[:_LISTED])
        raise RecipeError(
            f"{graph.scene_id}: {len(labelled)} rooms are called {name!r}; give the id of one: "
            f"{those}",
            code="room-ambiguous",
            where=name,
        )
    spoken = ids + [room.label for room in graph.rooms if room.label]
    hint = ask_if_meant(said, spoken) or f"rooms are {', '.join(ids[:_LISTED]) or 'none'}"
    raise RecipeError(
        f"{graph.scene_id}: no room {str(name)[:SHOWN]!r}; {hint}", code="room-unknown", where=name
    )


def set_hidden_shares(
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
    if every is not None and not graph.rooms:
        return replace(graph, hidden_share=ShareBelief(every).mean)
    shares = {} if every is None else dict.fromkeys(range(1, len(graph.rooms) + 1), every)
    shares |= {find_room(graph, name): share for name, share in rooms.items()}
    for index, said in shares.items():
        share, known = ShareBelief(said), list(graph.rooms)
        visited = share.mean < 1 and (share.mean == 0 or known[index - 1].visited)
        known[index - 1] = replace(known[index - 1], visited=visited)
        graph = hide_of_room(replace(graph, rooms=tuple(known)), index, share)
    return graph
