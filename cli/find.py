"""Answer `bsg-belief --find`: which rooms hold things, and where to go first."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from typing import Any

import bsg_models
from bsg_cli.terminal import print_json, print_note, print_text
from bsg_data.tables import format_text, make_line

EXPLORE = bsg_models.EXPLORE
_MOST_ROWS, _MOST_STEPS = 20, 5
_SURE = 0.95  # a building that has one so surely: what the rooms have if there is one is no news


def find_things(
    seen: bsg_models.SeenBuilding,
    things: Sequence[str],
    *,
    as_json: bool,
    here: str | None = None,
    note: Callable[[str], None] = print_note,
    **search: Any,
) -> dict[str, Any]:
    """Print where things probably are in a partly seen building, and where to go first.

    JSON has room ids, and is returned; text has labels as well. See `describe_things`.
    """
    facts = describe_things(seen, things, here=here, **search)
    if as_json:
        print_json(facts)
        return facts
    unit = facts["cost_unit"]
    for thing in things:
        meaning = seen.understand(thing)
        if meaning.how:
            note(meaning.how)
        places = seen.where(thing, here=here)
        _print_places(seen, meaning, places, unit, first=facts["go_first"])
        if len(things) > 1:
            print_text("")
    _print_plan(seen, facts, unit)
    return facts


def describe_things(
    seen: bsg_models.SeenBuilding,
    things: Sequence[str],
    *,
    here: str | None,
    robots: Mapping[str, str] | None = None,
    **options: Any,
) -> dict[str, Any]:
    """Return where things probably are, and where to go first: what every door answers.

    Args:
        seen: the building.
        things: in any words.
        here: the robot's room.
        robots: name of each of several robots → its room, instead of `here`.
        options: `look`, `chance` and `task` of `next_room`.
    """
    # Imported here: a help or a typo must not wait for SciPy.
    from bsg_models.robot.words import find_room

    if here is not None:
        here = seen.rooms[find_room(seen.graph, here) - 1]  # which may be said by its label
    facts: dict[str, Any] = {"things": [_describe(seen, word, here) for word in things]}
    steps: Sequence[bsg_models.Step] = ()
    first = firsts = None
    if robots:
        firsts = seen.next_rooms(robots, things, **options)
    elif here is None:
        first = seen.next_room(things, **options)
    else:
        steps = seen.explain(things, here=here, **options)
        first = steps[0].room if steps else None
    facts |= {"go_first": first, "plan": list(map(asdict, steps)), "robots": firsts}
    return {**facts, "cost_unit": None if here is None else seen.ways().unit, "here": here}


def describe_place(
    seen: bsg_models.SeenBuilding, thing: str, *, here: str, **options: Any
) -> dict[str, Any]:
    """Return the piece of furniture to look at next: what every door answers.

    Args:
        seen: the building.
        thing: any word.
        here: the robot's room.
        options: `at`, `look` and `chance` of `next_place`.
    """
    go = seen.next_place(thing, here=here, **options)
    return {"thing": thing, "room": go and go.room, "piece": go and go.piece}


def _describe(seen: bsg_models.SeenBuilding, thing: str, here: str | None) -> dict[str, Any]:
    meaning = seen.understand(thing)
    return {
        "thing": meaning.word,
        "class": None if meaning.thing else meaning.class_name,
        "how": meaning.how,
        "by": _answerer(meaning),
        "model": seen.asked(meaning.word),
        "anywhere": seen.anywhere(meaning.word),
        "places": list(map(asdict, seen.where(meaning.word, here=here))),
    }


def _answerer(meaning: bsg_models.Meaning) -> str:
    """Return what answers for a word: counts of a class, the table of things, or likeness."""
    if meaning.thing is not None:
        return "table"
    return "likeness" if meaning.class_name is None else "class"


def _print_places(
    seen: bsg_models.SeenBuilding,
    meaning: bsg_models.Meaning,
    places: Sequence[bsg_models.Place],
    unit: str | None,
    *,
    first: str | None,
) -> None:
    """Print the rooms of one thing as a table, then its furniture, and if the building has one."""
    anywhere, is_counted = seen.anywhere(meaning.word), _answerer(meaning) != "likeness"
    words = {obj.name: f"{obj.name} ({obj.raw_category})" for obj in seen.graph.objects}
    columns: dict[str, Callable[[bsg_models.Place], str]] = {
        "room": _name,
        f"P({meaning.name})": lambda place: _percent(place.probability),
        "if there is one": lambda place: _percent(place.if_there),
        "expected more": lambda place: f"{place.expected:.2f}",
        "seen": lambda place: ", ".join(words[one] for one in place.seen) or "–",
        "cost": lambda place: _cost(place.cost, unit),
    }
    order = [*columns]
    if not is_counted:  # what annotators write down says little of how many homes have one
        order[1:3] = ["if there is one", "noted"]
        columns["noted"] = columns[f"P({meaning.name})"]
    elif anywhere >= _SURE:
        order.remove("if there is one")
    if unit is None:
        order.remove("cost")
    rows = [[columns[name](place) for name in order] for place in places[:_MOST_ROWS]]
    numbers = [name for name in order if name not in ("room", "seen")]
    print_text(format_text(rows, header=order, numeric=numbers))
    if len(places) > _MOST_ROWS:
        print_note(f"… and {len(places) - _MOST_ROWS:,} less likely rooms; --json prints all")
    named = [place for place in places if place.pieces and place.room in (first, places[0].room)]
    for place in named:
        print_text(_describe_pieces(place))
    model = seen.asked(meaning.word)
    if meaning.thing is not None:
        print_text(f"somewhere in the building: {_percent(anywhere)}, by the table {model}")
    elif is_counted:
        source = "" if meaning.noun is None else "the table of nouns and "
        print_text(f"somewhere in the building: {_percent(anywhere)}, by {source}the model {model}")
    else:
        print_text(
            f"noted: annotators write one down in {_percent(anywhere)} of such buildings, by the "
            f"table of nouns and the model {model}"
        )


def _describe_pieces(place: bsg_models.Place) -> str:
    """Return the likeliest pieces of furniture of a room, if an unseen thing is there."""
    pieces = (
        f"{make_line(piece.name)} {'(seen there)' if piece.seen else _percent(piece.if_there)}"
        for piece in place.pieces
    )
    return f"{_name(place)}, if it is there: {', '.join(pieces)}"


def _print_plan(seen: bsg_models.SeenBuilding, facts: Mapping[str, Any], unit: str | None) -> None:
    """Print the room to go to first, and the order of the search if it has several steps."""
    labels = {room.name: room.label for room in seen.graph.rooms}
    for robot, first in (facts["robots"] or {"": facts["go_first"]}).items():
        said = "no room is left to search"
        if first == EXPLORE:
            said = "explore first: find the rooms that are not found yet"
        elif first is not None:
            said = f"go first to {_call(first, labels.get(first))}"
        print_text(f"{robot}: {said}" if robot else said)
    steps = facts["plan"]
    if len(steps) < 2:
        return
    rows = [
        (
            _call(step["room"], step["label"]),
            _percent(step["probability"]),
            _cost(step["way"], unit),
            _cost(step["look"], unit, here="nothing"),
            _percent(step["found"]),
        )
        for step in steps[:_MOST_STEPS]
    ]
    header = ("look into", "P", "way", "look", "ended by then")
    print_text("\n" + format_text(rows, header=header, numeric=header[1:]))
    if len(steps) > _MOST_STEPS:
        print_note(f"… and {len(steps) - _MOST_STEPS:,} more rooms; --json prints all")


def _name(place: bsg_models.Place) -> str:
    if place.room is None:
        return "in no room"
    from bsg_data.scene.room_label import is_name  # as above: a help must not wait for NumPy

    kind = None if is_name(place.room) else place.kind
    return _call(place.room, place.label or kind)


def _call(room: str, label: str | None) -> str:
    """Return the id of a room, with its label if it has another one."""
    if room == EXPLORE:
        return str(label)
    return make_line(room if label in (None, room) else f"{room} ({label})")


def _cost(cost: float | None, unit: str | None, *, here: str = "here") -> str:
    if cost is None:
        return "unknown"
    if cost == 0:
        return here
    if unit == "rooms":
        shown = f"{cost:.1f}".removesuffix(".0")
        return f"{shown} {'room' if shown == '1' else 'rooms'}"
    return f"{cost:.1f} m"


def _percent(probability: float) -> str:
    return "<1 %" if 0 < probability < 0.005 else f"{probability:.0%}".replace("%", " %")
