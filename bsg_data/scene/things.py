"""Everyday things: in which rooms a person would search for them, and whether a home has one.

`mappings/things-v1.csv` has `thing,spellings,wider,rooms,home`, written by hand
(`mappings/things-v1.md`). It knows names exactly, and the plural of each: it guesses nothing.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache, lru_cache

from bsg_data.errors import ClassMapError
from bsg_data.scene.class_map import normalise_name
from bsg_data.scene.class_space import load_class_space, read_published, read_rows
from bsg_data.scene.name_rules import LONGEST, separate, singulars, take_apart
from bsg_data.scene.room_label import known_label, label_of
from bsg_data.spelling import show_value

_FILE = "things-v1.csv"
_HEADER = ("thing", "spellings", "wider", "rooms", "home")
_SPACES = ("hm3d45-v2", "hm3d-wide-v1")  # whose classes `wider` names
_SEPARATOR = "|"
_NUMBERED = re.compile(r"[\W_]*\d+$")  # of `AirFryer_2`
_NUMBER = re.compile(r"[0-9]{1,3}(\.[0-9]+)?")


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
    keys = dict.fromkeys((_spell(word), _spell(apart), _spell(_NUMBERED.sub("", apart))))
    for key in keys:
        forms = (key, *sorted(singulars(key), key=len, reverse=True))  # canes are no cans
        for form in (*forms, *(form.replace(" ", "") for form in forms)):
            if form in listed:
                return listed[form]
    return None


@cache
def _read_things() -> tuple[tuple[Thing, ...], Mapping[str, Thing]]:
    things = parse_things(read_published(_FILE))
    listed = {_spell(one): thing for thing in things for one in (thing.name, *thing.spellings)}
    joined = {name.replace(" ", ""): thing for name, thing in listed.items()}
    return things, joined | listed


def parse_things(data: bytes) -> tuple[Thing, ...]:
    """Parse the table; `ClassMapError` names the line at fault."""
    classes = {name for space in _SPACES for name in load_class_space(space).classes}
    things: list[Thing] = []
    seen: set[str] = set()
    for line, (name, spellings, wider, rooms, home) in read_rows(_FILE, data, _HEADER):
        where = f"{_FILE}, line {line}"
        names = (name, *(spellings.split(_SEPARATOR) if spellings else ()))
        for one in names:
            if one != normalise_name(one) or not one or _spell(one) in seen:
                raise ClassMapError(
                    f"{where}: expected a new name in lower case, found {show_value(one)}"
                )
            seen.add(_spell(one))
        if wider and wider not in classes:
            raise ClassMapError(
                f"{where}: expected a class of {' or '.join(_SPACES)}, found {show_value(wider)}"
            )
        if not _NUMBER.fullmatch(home) or float(home) > 100:
            raise ClassMapError(f"{where}: expected a percentage, found {show_value(home)}")
        things.append(
            Thing(name, names[1:], wider or None, _parse_rooms(where, rooms), float(home) / 100)
        )
    return tuple(things)


def _parse_rooms(where: str, rooms: str) -> tuple[tuple[str, float], ...]:
    weights: dict[str, float] = {}
    for room in rooms.split(_SEPARATOR):
        label, _, weight = room.partition(":")
        known = label_of("any", label) == label and label not in weights
        if not known or not _NUMBER.fullmatch(weight) or not float(weight):
            raise ClassMapError(
                f"{where}: expected a room label, a colon and a weight above 0, such as "
                f"kitchen:80, each label once; found {show_value(room)}"
            )
        weights[label] = float(weight)
    total = math.fsum(weights.values())
    return tuple((label, weight / total) for label, weight in weights.items())


def _spell(word: str) -> str:
    """Return the form in which names are compared: normalised, spaces for `-` and `_`."""
    return separate(normalise_name(word))
