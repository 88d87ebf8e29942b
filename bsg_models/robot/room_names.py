"""Which room a person means: by its id, or by its label."""

from __future__ import annotations

import difflib

from bsg_data.errors import RecipeError
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.scene.class_map import normalise_name

_SHOWN = 8  # rooms in an error


def find_room(graph: PartialGraph, name: str) -> int:
    """Return the index of the room that a name means, 1..R.

    A name is the id of a room, or the label of one room alone, in any case.

    Raises:
        RecipeError: if no room has the name, or several have the label.
    """
    ids = [room.name for room in graph.rooms]
    if name in ids:
        return ids.index(name) + 1
    said = normalise_name(str(name))
    labelled = [
        number
        for number, room in enumerate(graph.rooms, 1)
        if said in (normalise_name(room.label or ""), normalise_name(room.name))
    ]
    if len(labelled) == 1:
        return labelled[0]
    if labelled:
        those = ", ".join(ids[number - 1] for number in labelled[:_SHOWN])
        raise RecipeError(
            f"{graph.scene_id}: {len(labelled)} rooms are called {name!r}: name one by its id: "
            f"{those}"
        )
    raise RecipeError(f"{graph.scene_id}: no room {str(name)[:80]!r}{_suggest(graph, said)}")


def _suggest(graph: PartialGraph, said: str) -> str:
    names = [room.name for room in graph.rooms]
    spoken = names + [room.label for room in graph.rooms if room.label]
    near = difflib.get_close_matches(said[:80], spoken, n=1)
    hint = f"; did you mean {near[0]}?" if near else "."
    more = f" and {len(names) - _SHOWN} more" if len(names) > _SHOWN else ""
    return f"{hint} Rooms are {', '.join(names[:_SHOWN]) or 'none'}{more}"
