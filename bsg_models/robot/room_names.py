"""Find the room that a name means, by id or by label."""

from __future__ import annotations

from bsg_data.errors import RecipeError
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.scene.class_map import normalise_name
from bsg_data.spelling import SHOWN, ask_if_meant, show_value

_LISTED = 8  # rooms listed in an error


def find_room(graph: PartialGraph, name: str) -> int:
    """Return the index of the room that a name means, 1..R.

    A name is the id of a room, or a label that only one room has, in any case.

    Raises:
        RecipeError: if no room has the name, or several have the label.
    """
    name = name if isinstance(name, str) else show_value(name)
    ids = [room.name for room in graph.rooms]
    if name in ids:
        return ids.index(name) + 1
    said = normalise_name(name)
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
            f"{those}"
        )
    raise RecipeError(f"{graph.scene_id}: no room {name[:SHOWN]!r}{_suggest(graph, said)}")


def _suggest(graph: PartialGraph, said: str) -> str:
    names = [room.name for room in graph.rooms]
    spoken = names + [room.label for room in graph.rooms if room.label]
    meant = ask_if_meant(said, spoken)
    hint = f"; {meant}" if meant else "."
    more = f" and {len(names) - _LISTED} more" if len(names) > _LISTED else ""
    return f"{hint} Rooms are {', '.join(names[:_LISTED]) or 'none'}{more}"
