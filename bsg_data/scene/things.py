"""Everyday things: in which rooms a person would search for them, and whether a home has one.

`mappings/things-v1.csv` has `thing,spellings,wider,rooms,home`, written by hand
(`mappings/things-v1.md`). It knows names exactly, and the plural of each: it guesses nothing.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

from bsg_data.scene.class_map import normalise_names
from bsg_data.scene.class_space import read_published, read_rows
from bsg_data.scene.name_rules import LONGEST, singulars, take_apart
from bsg_data.scene.room_label import known_label

_FILE = "things-v1.csv"
_HEADER = ("thing", "spellings", "wider", "rooms", "home")
_NUMBERED = re.compile(r"[\W_]*\d+$")  # of `AirFryer_2`


@dataclass(frozen=True, slots=True)
class Thing:
    """A thing that people look for."""

    name: str
    spellings: tuple[str, ...]  # its other names
    wider: str | None  # the class that every such thing is of
    # (common label of a room, P(a search begins there)), the likeliest first. Labels
    # that only other buildings have are among them: divide by the sum over the rooms that there are
    rooms: tuple[tuple[str, float], ...]
    home: float  # P(a home has at least one)

    def probability_in(self, label: str) -> float:
        """Return P(a search begins in a room with a label), or with the label models read for it.

        Ask it for the rooms that there are. The table's own labels are never translated: medicine
        is in a pharmacy, which models read as a storage room, but in no storage room of a home.
        """
        rooms = dict(self.rooms)
        return rooms.get(label, rooms.get(known_label(label), 0.0))


def list_things() -> tuple[Thing, ...]:
    """Return all things, sorted by name."""
    return _read_things()[0]


@lru_cache(maxsize=64)
def find_thing(word: str) -> Thing | None:
    """Return the thing that a word names, in the singular or plural; None for other words.

    A word that is listed itself comes first: `glasses` are eyeglasses, a `glass` is to drink from.

    >>> [thing.name for word in ("Hoover", "knives", "T_shirt") if (thing := find_thing(word))]
    ['vacuum cleaner', 'knife', 't-shirt']
    >>> [thing.name for word in ("AirFryer_2", "teaspoons") if (thing := find_thing(word))]
    ['air fryer', 'spoon']
    >>> find_thing("kitchen sofa") is None
    True
    """
    if len(word) > LONGEST:
        return None
    listed = _read_things()[1]
    apart = take_apart(word)
    for key in dict.fromkeys(spell_names((word, apart, _NUMBERED.sub("", apart)))):
        forms = (key, *sorted(singulars(key), key=len, reverse=True))  # canes are no cans
        for form in (*forms, *(form.replace(" ", "") for form in forms)):
            if form in listed:
                return listed[form]
    return None


@cache
def _read_things() -> tuple[tuple[Thing, ...], Mapping[str, Thing]]:
    things = []
    for _, (name, said, wider, rooms, home) in read_rows(_FILE, read_published(_FILE), _HEADER):
        weights = {room: float(w) for room, _, w in [r.partition(":") for r in rooms.split("|")]}
        total = math.fsum(weights.values())
        shares = tuple([(room, weight / total) for room, weight in weights.items()])
        spellings = tuple(said.split("|")) if said else ()
        things.append(Thing(name, spellings, wider or None, shares, float(home) / 100))
    names = [(one, thing) for thing in things for one in (thing.name, *thing.spellings)]
    spelled = spell_names([one for one, _ in names])
    listed = {name: thing for name, (_, thing) in zip(spelled, names, strict=True)}
    joined = {name.replace(" ", ""): thing for name, thing in listed.items()}
    return tuple(things), joined | listed


def spell_names(words: Iterable[str]) -> list[str]:
    """Return the form in which names are compared: normalised, spaces for `-` and `_`."""
    said = normalise_names(words)
    return [" ".join(one.replace("-", " ").replace("_", " ").split()) for one in said]
