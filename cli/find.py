"""Answer `bsg-belief --find`: which rooms hold things, and where to go first."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

import bsg_models
from bsg_cli.terminal import print_json, print_note, print_text
from bsg_data.tables import format_text

MOST_ROWS = 20


def find_things(
    seen: bsg_models.SeenBuilding, things: Sequence[str], *, here: str | None, as_json: bool
) -> None:
    """Print where things probably are in a partly seen building, and where to go first.

    JSON has room ids; text has labels as well.
    """
    meanings = [seen.understand(thing) for thing in things]
    answers = [seen.where(thing, here=here) for thing in things]
    first = seen.next_room(things, here=here)
    unit = None if here is None else seen.ways().unit
    if as_json:
        facts = [_encode(seen, *answer) for answer in zip(meanings, answers, strict=True)]
        together = {"go_first": first, "cost_unit": unit}
        print_json({**facts[0], **together} if len(facts) == 1 else {"things": facts, **together})
        return
    for meaning, places in zip(meanings, answers, strict=True):
        _print_places(seen, meaning, places, unit)
        if len(things) > 1:
            print_text("")
    going = (
        "no room is left to search" if first is None else f"go first to {_name(first, answers[0])}"
    )
    print_text(going)


def _encode(
    seen: bsg_models.SeenBuilding, meaning: bsg_models.Meaning, places: Sequence[bsg_models.Place]
) -> dict[str, Any]:
    """Return what is known of one thing, ready for JSON."""
    return {
        "thing": meaning.word,
        "class": meaning.class_name,
        "how": meaning.how,
        "model": seen.asked(meaning.word),
        "anywhere": seen.anywhere(meaning.word),
        "places": [asdict(place) for place in places],
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
    header = ("room", f"P({meaning.class_name})", "expected more", "seen", "cost")
    words = {obj.name: obj.raw_category for obj in seen.graph.objects}
    rows = [_row(place, unit, words) for place in places]
    columns = len(header) if unit else len(header) - 1
    shown = [row[:columns] for row in rows[:MOST_ROWS]]
    print_text(format_text(shown, header=header[:columns], numeric=(*header[1:3], "cost")))
    if len(rows) > MOST_ROWS:
        print_note(f"… and {len(rows) - MOST_ROWS:,} less likely rooms; --json prints all")
    somewhere = _percent(seen.anywhere(meaning.word))
    print_text(f"somewhere in the building: {somewhere}, by the model {seen.asked(meaning.word)}")


def _row(place: bsg_models.Place, unit: str | None, words: Mapping[str, str]) -> tuple[Any, ...]:
    return (
        "in no room" if place.room is None else _name(place.room, [place]),
        _percent(place.probability),
        f"{place.expected:.2f}",
        ", ".join(f"{one} ({words[one]})" for one in place.seen) or "–",
        _cost(place.cost, unit),
    )


def _name(room: str, places: Sequence[bsg_models.Place]) -> str:
    """Return the id of a room, with its label if it has another one."""
    label = next(place.label for place in places if place.room == room)
    return room if label in (None, room) else f"{room} ({label})"


def _cost(cost: float | None, unit: str | None) -> str:
    if cost is None:
        return "–"
    if cost == 0:
        return "here"
    if unit == "rooms":
        return f"{cost:g} {'room' if cost == 1 else 'rooms'}"
    return f"{cost:.1f} m"


def _percent(probability: float) -> str:
    return "<1 %" if 0 < probability < 0.005 else f"{probability:.0%}".replace("%", " %")
