"""Write the explorer: belief graphs as one self-contained HTML page that needs no server.

`explorer.html.jinja` is filled with the beliefs as JSON. Everything that comes from the data is put
on the page as text, never as markup.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.files import AnyPath, write_bytes
from bsg_data.observation.partial_graph import KnownRoom
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.formats import FormatRow
from bsg_models.rendering.pages import render_page
from bsg_models.rendering.plan import KnownOutline, draw_plan, number_alike, outline_room
from bsg_models.rendering.shown_part import (
    ALL_OF_IT,
    ShownPart,
    choose_shown_part,
    count_buildings,
)

_DIGITS = 4
_ONE_ROW = 1e9  # an aspect so wide that all storeys lie in one row


@dataclass(frozen=True, eq=False)
class View:
    """One belief graph for the explorer.

    Attributes:
        belief: what was seen and what is believed.
        truth: `[N, C]` true counts, the building first; None where unknown.
        title: of the view; if empty, the scene id.
    """

    belief: BeliefGraph
    truth: npt.NDArray[np.integer] | None = None
    title: str = ""


def write_explorer(views: Sequence[View], path: AnyPath) -> None:
    """Write the explorer page of some belief graphs. A failed write leaves no partial file."""
    path = Path(path)
    write_bytes(path, explorer_page(views).encode())


def explorer_page(views: Sequence[View]) -> str:
    """Return the explorer page of some views; the first is open.

    The page says at its top what it leaves out: parts of large buildings, and buildings beyond the
    limit of a page (`shown_part.py`).
    """
    parts = [choose_shown_part(view.belief) for view in views]
    shown = count_buildings(parts)
    said = ""
    if shown < len(views):
        said = f"This page shows the first {shown:,} of {len(views):,} buildings. {ALL_OF_IT}"
    encoded = [_encode(view, part) for view, part in zip(views[:shown], parts, strict=False)]
    return render_page("explorer.html.jinja", data={"views": encoded, "left_out": said})


def _encode(view: View, part: ShownPart) -> dict[str, Any]:
    belief, partial = view.belief, view.belief.partial
    nodes = [0, *part.rooms]
    rooms = [partial.rooms[number - 1] for number in part.rooms]
    place = {number: node for node, number in enumerate(nodes)}
    names = [_name(room) for room in partial.rooms]
    if len(rooms) < len(partial.rooms):  # numbered names count the rooms that are left out, too
        names = list(number_alike(names))
    known = [
        KnownOutline(node, names[number - 1], outline_room(room, room.position), room.floor_index)
        for node, (number, room) in enumerate(zip(part.rooms, rooms, strict=True), start=1)
    ]
    plan, row = draw_plan(known), draw_plan(known, aspect=_ONE_ROW)
    drawn_names = {room.number: room.name for room in plan.rooms}
    classless = Counter(obj.room_index for obj in partial.objects if obj.class_index is None)
    return {
        "title": view.title or partial.scene_id,
        "left_out": part.left_out,
        "model": belief.model,
        "mode": belief.mode,
        "classes": list(partial.class_space.classes),
        "hidden_share": round(partial.hidden_share, _DIGITS),
        "input": belief.inputs[nodes].astype(int).tolist(),
        "expected": np.round(belief.expected[nodes], _DIGITS).tolist(),
        "presence": np.round(belief.presence[nodes], _DIGITS).tolist(),
        "truth": None if view.truth is None else np.asarray(view.truth)[nodes].tolist(),
        "classless": [classless.total(), *(classless[number] for number in part.rooms)],
        "rooms": [
            {
                "id": room.name,
                "name": drawn_names[drawn.number],
                "visited": room.visited,
                "share": round(room.hidden_share, _DIGITS),
                "corner": drawn.outline and drawn.outline[0],
            }
            for room, drawn in zip(rooms, known, strict=True)
        ],
        "plan": asdict(plan),
        "row": asdict(row),
        "objects": [
            {
                "room": place[obj.room_index],
                "name": obj.raw_category,
                "class": obj.class_index,
                "at": None if obj.position is None else [round(v, 2) for v in obj.position],
            }
            for obj in (partial.objects[number] for number in part.objects)
        ],
        "blind": [
            {
                "room": place[node.room_index],
                "class": node.class_index,
                "expected": round(node.expected, _DIGITS),
                "presence": round(node.presence, _DIGITS),
            }
            for node in (belief.blind[number] for number in part.blind)
        ],
        "adjacency": [
            [place[a], place[b]] for a, b in partial.adjacency if a in place and b in place
        ],
    }


def _name(room: KnownRoom) -> str:
    """Return the name of a room: its label, else its id."""
    return room.label or (f"room {room.name}" if room.name.isdecimal() else room.name)


def _write_beliefs(beliefs: Iterable[BeliefGraph], path: Path) -> None:
    write_explorer([View(belief) for belief in beliefs], path)


HTML = FormatRow("html", (".html", ".htm"), write_all=_write_beliefs)
