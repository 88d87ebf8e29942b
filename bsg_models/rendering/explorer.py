"""The explorer: belief graphs as one self-contained HTML page, to look at without a server.

The page is `explorer.html.jinja` with the beliefs written into it as JSON. Everything that comes
from the data is put on the page as text, never as markup.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.files import write_bytes
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.formats import FormatRow
from bsg_models.rendering.pages import render_page
from bsg_models.rendering.plan import outline_room

_DIGITS = 4


@dataclass(frozen=True, slots=True)
class Moment:
    """A moment of a search; rooms are numbered as in its belief graph.

    Attributes:
        artifacts: classes that are searched for.
        route: rooms in the order in which they were entered; the robot is in the last.
        cost: travelled so far.
        target: room where it goes next; None at the end.
        legs: `[N]` what it would cost to go to each node, None out of reach; nothing at the end.
        holds: rooms that hold an artifact, which the robot does not know.
        planner: that decides.
        world: whose costs it travels at.
    """

    artifacts: tuple[int, ...]
    route: tuple[int, ...]
    cost: float
    target: int | None
    legs: tuple[float | None, ...]
    holds: tuple[int, ...]
    planner: str
    world: str


@dataclass(frozen=True, eq=False)
class View:
    """One belief graph to look at.

    Attributes:
        belief: what was seen and what is believed.
        truth: `[N, C]` what is there, the building first; None where nobody knows.
        title: of the view; the scene id if empty.
        moment: of a search; the views of a page are then its steps, in order.
    """

    belief: BeliefGraph
    truth: npt.NDArray[np.integer] | None = None
    title: str = ""
    moment: Moment | None = None


def write_explorer(views: Sequence[View], path: Path) -> None:
    """Write the page, whole or not at all."""
    write_bytes(path, explorer_page(views).encode())


def explorer_page(views: Sequence[View]) -> str:
    """Return the page of some views, the first of them open."""
    return render_page("explorer.html.jinja", data={"views": [_encode(view) for view in views]})


def _encode(view: View) -> dict[str, Any]:
    belief, partial = view.belief, view.belief.partial
    return {
        "title": view.title or partial.scene_id,
        "model": belief.model,
        "mode": belief.mode,
        "classes": list(partial.class_space.classes),
        "hidden_share": round(partial.hidden_share, _DIGITS),
        "input": belief.inputs.astype(int).tolist(),
        "expected": np.round(belief.expected, _DIGITS).tolist(),
        "presence": np.round(belief.presence, _DIGITS).tolist(),
        "truth": None if view.truth is None else np.asarray(view.truth).tolist(),
        "rooms": [
            {
                "name": room.name,
                "label": room.label,
                "visited": room.visited,
                "share": round(room.hidden_share, _DIGITS),
                "floor": room.floor_index or 0,
                "outline": outline_room(room, room.position),
            }
            for room in partial.rooms
        ],
        "objects": [
            {
                "room": obj.room_index,
                "name": obj.raw_category,
                "class": obj.class_index,
                "at": None if obj.position is None else [round(v, 2) for v in obj.position],
            }
            for obj in partial.objects
        ],
        "blind": [
            {
                "room": node.room_index,
                "class": node.class_index,
                "expected": round(node.expected, _DIGITS),
                "presence": round(node.presence, _DIGITS),
            }
            for node in belief.blind
        ],
        "moment": None if view.moment is None else asdict(view.moment),
        "adjacency": [list(pair) for pair in partial.adjacency],
    }


def _write_beliefs(beliefs: Iterable[BeliefGraph], path: Path) -> None:
    write_explorer([View(belief) for belief in beliefs], path)


HTML = FormatRow("html", (".html", ".htm"), write_all=_write_beliefs)
