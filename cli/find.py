"""Answer `bsg-belief --find`: which rooms hold things, and where to go first."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import bsg_models
from bsg_cli.terminal import print_json, print_note, print_text
from bsg_data.tables import format_text

_MOST_ROWS = 20


def find_things(
    seen: bsg_models.SeenBuilding, things: Sequence[str], *, here: str | None, as_json: bool
) -> None:
    """Print where things probably are in a partly seen building, and where to go first.

    JSON has room ids; text has labels as well.
    """
    if as_json:
        print_json(describe_things(seen, things[0] if len(things) == 1 else things, here=here))
        return
    meanings = [seen.understand(thing) for thing in things]
    answers = [seen.where(thing, here=here) for thing in things]
    first = seen.next_room(things, here=here)
    unit = None if here is None else seen.ways().unit
    for meaning, places in zip(meanings, answers, strict=True):
        _print_places(seen, meaning, places, unit)
        if len(things) > 1:
            print_text("")
    if first is None:
        print_text("no room is left to search")
    else:
        print_text(f"go first to {_name(next(p for p in answers[0] if p.room == first))}")


def describe_things(
    seen: bsg_models.SeenBuilding, things: str | Sequence[str], *, here: str | None
) -> dict[str, Any]:
    """Return where things probably are, and where to go first, as JSON has it.

    What is said of a thing stands at the top if `things` is a word, and in a list if it is a list.
    """
    if isinstance(things, str):
        facts = _describe(seen, things, here)
    else:
        facts = {"things": [_describe(seen, thing, here) for thing in things]}
    unit = None if here is None else seen.ways().unit
    return {**facts, "go_first": seen.next_room(things, here=here), "cost_unit": unit}


def _describe(seen: bsg_models.SeenBuilding, thing: str, here: str | None) -> dict[str, Any]:
    meaning = seen.understand(thing)
    return {
        "thing": meaning.word,
        "class": meaning.class_name,
        "how": meaning.how,
        "model": seen.asked(meaning.word),
        "anywhere": seen.anywhere(meaning.word),
        "places": list(map(asdict, seen.where(meaning.word, here=here))),
    }


def _print_places(
    seen: bsg_models.SeenBuilding,
    meaning: bsg_models.Meaning,
    places: Sequence[bsg_models.Place],
    unit: str | None,
) -> None:
    """Print the rooms of one thing as a table, then how likely the building has one."""
    if meaning.how:
        print_note(meaning.how)
    header = ("room", f"P({meaning.name})", "expected more", "seen", "cost")
    words = {obj.name: f"{obj.name} ({obj.raw_category})" for obj in seen.graph.objects}
    columns = len(header) if unit else len(header) - 1
    rows = [
        (
            _name(place),
            _percent(place.probability),
            f"{place.expected:.2f}",
            ", ".join(words[one] for one in place.seen) or "–",
            _cost(place.cost, unit),
        )[:columns]
        for place in places[:_MOST_ROWS]
    ]
    print_text(format_text(rows, header=header[:columns], numeric=(*header[1:3], "cost")))
    if len(places) > _MOST_ROWS:
        print_note(f"… and {len(places) - _MOST_ROWS:,} less likely rooms; --json prints all")
    somewhere = _percent(seen.anywhere(meaning.word))
    source = "" if meaning.noun is None else "the table of nouns and "
    model = seen.asked(meaning.word)
    print_text(f"somewhere in the building: {somewhere}, by {source}the model {model}")


def _name(place: bsg_models.Place) -> str:
    """Return the id of a room, with its label if it has another one."""
    if place.room is None:
        return "in no room"
    return place.room if place.label in (None, place.room) else f"{place.room} ({place.label})"


def _cost(cost: float | None, unit: str | None) -> str:
    if cost is None:
        return "unknown"
    if cost == 0:
        return "here"
    if unit == "rooms":
        return f"{cost:g} {'room' if cost == 1 else 'rooms'}"
    return f"{cost:.1f} m"


def _percent(probability: float) -> str:
    return "<1 %" if 0 < probability < 0.005 else f"{probability:.0%}".replace("%", " %")
