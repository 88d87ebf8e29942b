"""Write the explorer: belief graphs as one self-contained HTML page that needs no server.

`explorer.html.jinja` is filled with the beliefs as JSON. Everything that comes from the data is put
on the page as text, never as markup.

A browser draws a few thousand dots smoothly, and a page should fit into a mail, so a page shows a
part of a very large building. The numbers of a building always count all of it.
"""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.files import AnyPath, write_bytes
from bsg_models.belief.belief_graph import BeliefGraph
from bsg_models.belief.clock import show_time
from bsg_models.belief.partial_graph import KnownRoom
from bsg_models.rendering.habits import Taught
from bsg_models.rendering.pages import render_page
from bsg_models.rendering.plan import (
    KnownOutline,
    draw_plan,
    number_alike,
    outline_room,
    place_beside,
)

MOST_ROOMS = 200  # of a building
MOST_OBJECTS = 2_500  # of a building; also the limit of its blind nodes
_LIKELIEST = 3  # rooms shown for every class
_FIRST = 10  # rooms of an answer's way and ranking that are shown in any case
_EXPLORE = "explore"  # instead of a room: those not found yet
_ALL_OF_IT = "`bsg-belief … --out beliefs.json` writes everything."
_DIGITS = 4
_ONE_ROW = 1e9  # an aspect so wide that all storeys lie in one row


@dataclass(frozen=True, eq=False)
class ShownBelief:
    """One belief graph for the explorer.

    An answer says where things are that somebody asked for, in its `places`, and in which order
    the robot would search the rooms, in its `plan`. It names rooms by their ids.
    """

    belief: BeliefGraph
    truth: npt.NDArray[np.integer] | None = None  # [N, C] counts, the building first
    answer: Mapping[str, Any] | None = None  # the page opens with its first thing picked
    kinds: Sequence[str] = ()  # that rooms are taken for, with their probability; or empty


def write_explorer(views: Sequence[ShownBelief], path: AnyPath) -> None:
    """Write the explorer page of some belief graphs. A failed write leaves no partial file."""
    write_bytes(Path(path), explorer_page(views).encode())


def explorer_page(views: Sequence[ShownBelief]) -> str:
    """Return the explorer page of some views; the first is open.

    Of a large building, the page says what it leaves out.
    """
    data = {"views": [_encode(view) for view in views]}
    return render_page("explorer.html.jinja", data=data)


def _encode(view: ShownBelief) -> dict[str, Any]:
    belief, partial, taught = view.belief, view.belief.partial, Taught(view.belief.partial)
    rooms = _choose_rooms(belief, view.answer)
    nodes = [0, *rooms]
    place = {number: node for node, number in enumerate(nodes)}
    dots = _encode_dots(belief, place, view.answer)
    numbers = {partial.rooms[number - 1].name: node for node, number in enumerate(rooms, 1)}
    classless = Counter(obj.room_index for obj in partial.objects if obj.class_index is None)
    return {
        "title": partial.scene_id,
        "left_out": _say_left_out(view, len(rooms), len(dots["objects"]), len(dots["blind"])),
        "model": belief.model,
        "mode": belief.mode,
        "classes": list(partial.class_space.classes),
        "hidden_share": round(partial.hidden_share, _DIGITS),
        "input": belief.inputs[nodes].astype(int).tolist(),
        "expected": np.round(belief.expected[nodes], _DIGITS).tolist(),
        "presence": np.round(belief.presence[nodes], _DIGITS).tolist(),
        "truth": None if view.truth is None else np.asarray(view.truth)[nodes].tolist(),
        "classless": [classless.total(), *(classless[number] for number in rooms)],
        **_encode_rooms(partial.rooms, rooms, kinds=view.kinds or [""] * len(partial.rooms)),
        **dots,
        "adjacency": [
            [place[a], place[b]] for a, b in partial.adjacency if a in place and b in place
        ],
        "now": _show_now(partial.now),
        "taught": taught.rows(),
        "answer": None if view.answer is None else _encode_answer(view.answer, taught, numbers),
    }


def _show_now(now: float | None) -> str | None:
    shown = None if now is None else show_time(float(round(now)))
    return f"{shown:,.0f} s" if isinstance(shown, float) else shown


def _encode_answer(
    answer: Mapping[str, Any], taught: Taught, nodes: Mapping[str, int]
) -> dict[str, Any]:
    """Return an answer for the page; `nodes` is id of a room → its node, of the shown rooms."""
    find: dict[str | None, Any] = {None: None, _EXPLORE: _EXPLORE} | dict(nodes.items())

    def show(rows: Iterable[Mapping[str, Any]]) -> list[dict[str, Any]]:
        return [
            {**{key: _round(value) for key, value in row.items()}, "room": find[row["room"]]}
            for row in rows
            if row["room"] in find
        ]

    return {
        **answer,
        "here": find.get(answer["here"]),
        "go_first": find.get(answer["go_first"]),
        "things": [
            {
                **thing,
                "anywhere": _round(thing["anywhere"]),
                "places": show(thing["places"]),
                "habits": [taught.row(habit) for habit in thing["habits"]],
            }
            for thing in answer["things"]
        ],
        "plan": show({**stop, "step": step} for step, stop in enumerate(answer["plan"], 1)),
    }


def _round(value: Any) -> Any:
    """Return a number with few digits, one that is not finite as None, and all else as it is."""
    if not isinstance(value, float):
        return value
    return round(value, _DIGITS) if math.isfinite(value) else None


def _encode_dots(
    belief: BeliefGraph, place: Mapping[int, int], answer: Mapping[str, Any] | None
) -> dict[str, Any]:
    """Return the shown objects and blind nodes; `place` is room → its node on the page."""
    things = [] if answer is None else answer["things"]
    ids = [{name for spot in thing["places"] for name in spot["seen"]} for thing in things]
    names = belief.partial.class_space.classes
    every = belief.partial.objects
    places = {obj.name: obj.position for obj in every}
    objects = _take_evenly([obj.room_index for obj in every], list(place))
    blind = _take_evenly([node.room_index for node in belief.blind], list(place))
    return {
        "objects": [
            {
                "room": place[obj.room_index],
                "name": obj.raw_category,
                "class": obj.class_index,
                "at": None if obj.position is None else [round(v, 2) for v in obj.position],
                **_note_asked(obj.name in some for some in ids),
            }
            for obj in (every[number] for number in objects)
        ],
        "blind": [
            {
                "room": place[node.room_index],
                "class": node.class_index,
                "expected": round(node.expected, _DIGITS),
                "presence": round(node.presence, _DIGITS),
                "at": place_beside(places.get(node.on or ""), number),
                **_note_asked(thing["class"] == names[node.class_index] for thing in things),
            }
            for number, node in ((number, belief.blind[number]) for number in blind)
        ],
    }


def _note_asked(answers: Iterable[bool]) -> dict[str, Any]:
    """Return which of the things that were asked for this is one of, by number, if any."""
    asked = [number for number, is_one in enumerate(answers) if is_one]
    return {"asked": asked} if asked else {}


def _encode_rooms(
    rooms: Sequence[KnownRoom], shown: Sequence[int], *, kinds: Sequence[str]
) -> dict[str, Any]:
    """Return the shown rooms and where they are drawn: as a plan, and in a row."""
    names = [_name(room) for room in rooms]
    if len(shown) < len(rooms):  # numbered names count the rooms that are left out, too
        names = list(number_alike(names))
    shown_rooms = [rooms[number - 1] for number in shown]
    known = [
        KnownOutline(node, names[number - 1], outline_room(room, room.position), room.floor_index)
        for node, (number, room) in enumerate(zip(shown, shown_rooms, strict=True), start=1)
    ]
    plan, row = draw_plan(known), draw_plan(known, aspect=_ONE_ROW)
    drawn_names = {room.number: room.name for room in plan.rooms}
    encoded = [
        {
            "id": room.name,
            "name": drawn_names[drawn.number],
            "visited": room.visited,
            "kind": kinds[number - 1],
            "share": round(room.hidden_share, _DIGITS),
            "corner": drawn.outline and drawn.outline[0],
        }
        for number, room, drawn in zip(shown, shown_rooms, known, strict=True)
    ]
    return {"rooms": encoded, "plan": asdict(plan), "row": asdict(row)}


def _name(room: KnownRoom) -> str:
    return room.label or (f"room {room.name}" if room.name.isdecimal() else room.name)


def _choose_rooms(belief: BeliefGraph, answer: Mapping[str, Any] | None) -> list[int]:
    """Return the rooms to show, 1..R.

    First come those of the answer, then the likeliest of every class, then those where most is
    expected.
    """
    number = len(belief.partial.rooms)
    if number <= MOST_ROOMS:
        return list(range(1, number + 1))
    likeliest = np.argsort(-belief.presence[1:], axis=0, kind="stable")[:_LIKELIEST]
    promising = np.argsort(-belief.hidden[1:].sum(axis=1), kind="stable")
    index = {room.name: number for number, room in enumerate(belief.partial.rooms)}
    first = [index[name] for name in _name_rooms(answer) if name in index]
    order = dict.fromkeys([*first, *likeliest.ravel().tolist(), *promising.tolist()])
    return sorted(room + 1 for room in list(order)[:MOST_ROOMS])


def _name_rooms(answer: Mapping[str, Any] | None) -> list[str | None]:
    """Return the ids of the rooms that an answer is about, if there is one."""
    if answer is None:
        return []
    lists = [answer["plan"], *(thing["places"] for thing in answer["things"])]
    named = [row["room"] for rows in lists for row in rows[:_FIRST]]
    return [answer["here"], answer["go_first"], *named]


def _take_evenly(rooms: Sequence[int], shown: Sequence[int]) -> list[int]:
    """Return at most `MOST_OBJECTS` things of shown rooms: the first of each, then the second."""
    before: Counter[int] = Counter()  # things of each room
    turns: list[tuple[int, int]] = []
    for thing, room in enumerate(rooms):
        if room in shown:
            turns.append((before[room], thing))
            before[room] += 1
    return sorted(thing for _, thing in sorted(turns)[:MOST_OBJECTS])


def _say_left_out(view: ShownBelief, rooms: int, objects: int, blind: int) -> str:
    belief, partial, answer = view.belief, view.belief.partial, view.answer
    every = (len(partial.rooms), len(partial.objects), len(belief.blind))
    if (rooms, objects, blind) == every:
        return ""
    rooms_are = "The rooms are" if answer is None else "The rooms are those of the answer, then"
    return (
        f"This page shows {rooms:,} of {every[0]:,} rooms, {objects:,} of {every[1]:,} seen "
        f"objects and {blind:,} of {every[2]:,} blind nodes. {rooms_are} the {_LIKELIEST} "
        "likeliest for each class, then those with the most expected unseen objects. The numbers "
        f"of the building and of each room count everything. {_ALL_OF_IT}"
    )
