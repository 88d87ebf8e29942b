"""Everyday things: in which rooms and on which furniture a person would search for them.

Six tables of `bsg_robot/tables/` say it, written by hand but for the shares of people
(`bsg_robot/tables/README.md`):

    things-v1.csv             a thing, its names, its class, the rooms where people look for it,
                              P(a home has one), how often one that is there is in sight, after
                              how many hours half of them are elsewhere, and its groups
    groups-v1.csv             a group of things, its names, whether they are kept together, and
                              whether what is gone is used up
    kinds-v1.csv              a kind of room, one that is furnished alike, and whether it holds only
                              what things-v1 names there
    receptacles-v1.csv        a piece of furniture, its names, the listed ones that it is like, if
                              it is opened, and whether it holds what keeping-v1 names alone
    receptacle-shares-v1.csv  share of people to whom things belong there, of all things together
    keeping-v1.csv            a kind of thing → the pieces where a person would look

Things are known by their exact names, and the plural of each: nothing is guessed. The pieces that
people were asked about are the columns of everything here, in the order of `Shares.pieces`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.scene.class_map import Classified, ClassMap
from bsg_data.scene.room_label import known_label
from bsg_data.words.normal import (
    LONGEST,
    drop_number,
    list_parts,
    separate,
    separate_names,
    singulars,
    take_apart,
)
from bsg_robot.tables.table import read_table, split_cell, split_weights

_FILE, _PIECES = "things-v1.csv", "receptacles-v1.csv"
_SHARES, _KEEPING = "receptacle-shares-v1.csv", "keeping-v1.csv"
_GROUPS = "groups-v1.csv"
_OPENED = {"yes": 1.0, "both": 0.5, "no": 0.0}


@dataclass(frozen=True, slots=True)
class Thing:
    """A thing that people look for."""

    name: str
    names: tuple[str, ...]  # all its names, this one first
    wider: str | None  # the class that every such thing is of
    # (common label of a room, weight), those of homes first, and of each the likeliest. The weights
    # of homes' rooms add up to 1; those of other rooms come on top, on the same scale.
    rooms: tuple[tuple[str, float], ...]
    home: float  # P(a home has at least one)
    sight: float  # P(one is in sight of somebody who sees the floor and surfaces of its room)
    stays: float  # hours after which half of them are elsewhere
    groups: tuple[str, ...]  # of things that people keep together, rows of groups-v1

    def probability_in(self, label: str) -> float:
        """Return the weight of rooms with a label, or with the label by which models read it.

        P(a search begins there) is its share in the weights of the rooms that there are. The
        table's own labels are never translated: medicine is in a pharmacy, which models read as a
        storage room, but in no storage room of a home. A narrow room has what is named there alone.
        """
        rooms = dict(self.rooms)
        if label in rooms or label in read_narrow():
            return rooms.get(label, 0.0)
        return rooms.get(known_label(label), 0.0)


def list_things() -> tuple[Thing, ...]:
    """Return all things, sorted by name."""
    return _read_things()[0]


def list_narrower(thing: Thing) -> tuple[Thing, ...]:
    """Return the things of which each is also such a thing: mugs of tableware."""
    return tuple([part for name in thing.names for part in _group_narrower().get(name, ())])


@cache
def _group_narrower() -> Mapping[str, list[Thing]]:
    found: dict[str, list[Thing]] = {}
    for thing in list_things():
        if thing.wider is not None and thing.wider not in thing.names:
            found.setdefault(thing.wider, []).append(thing)
    return found


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
    spoken, apart = separate(word), separate(take_apart(word))
    for key in dict.fromkeys((spoken, apart, drop_number(apart))):
        forms = (key, *sorted(singulars(key), key=len, reverse=True))  # canes are no cans
        joined = (form.replace(" ", "") for form in forms if form[:2] != "a ")  # a tv is no atv
        found = (listed[form] for form in (*forms, *joined) if form in listed)
        if thing := next(found, None):
            return thing
    return None


def classify_seen(word: str, class_map: ClassMap) -> Classified:
    """Classify a robot's word as a question for it is: also by the other names of its thing.

    >>> from bsg_data import load_class_map
    >>> classify_seen("telly", load_class_map()).category
    'tv'
    """
    known = class_map.classify(word)
    things = map(find_thing, () if known.role != "unmapped" else (word, *list_parts(word)))
    if thing := next(filter(None, things), None):
        counted = (class_map.classify(name) for name in class_map.classes if name in thing.names)
        return next((replace(entry, rule="synonym") for entry in counted), known)
    return known


@cache
def _read_things() -> tuple[tuple[Thing, ...], Mapping[str, Thing]]:
    """Return the rows of the table, and each by its names, with and without their spaces."""
    rows = zip(*read_table(_FILE).values(), strict=True)
    things = tuple(
        Thing(
            name=name,
            names=(name, *split_cell(spellings)),
            wider=wider or None,
            rooms=split_weights(rooms, of=100.0),
            home=float(home) / 100,
            sight=float(sight) / 100,
            stays=float(stays),
            groups=split_cell(groups),
        )
        for name, spellings, wider, rooms, home, sight, stays, groups in rows
    )
    names = separate_names([name for thing in things for name in thing.names])
    named = [thing for thing in things for _ in thing.names]
    listed = dict(zip(names, named, strict=True))
    return things, {name.replace(" ", ""): thing for name, thing in listed.items()} | listed


def find_group(word: str) -> str | None:
    """Return the group of things that a word names.

    >>> find_group("cleaning supplies"), find_group("Beverages"), find_group("mug")
    ('cleaning', 'drink', None)
    """
    spoken, groups = separate(word[:LONGEST]), _read_groups()[0]
    return next((groups[form] for form in (spoken, *singulars(spoken)) if form in groups), None)


def keeps_together(group: str) -> bool:
    """Return whether where one thing of a group is tells where people keep the others."""
    return group in _read_groups()[1]


def uses_up(group: str) -> bool:
    """Return whether a thing of a group that is gone is used up, as food is."""
    return group in _read_groups()[2]


@cache
def _read_groups() -> tuple[Mapping[str, str], frozenset[str], frozenset[str]]:
    groups, spellings, *flags = read_table(_GROUPS).values()
    rows = [*zip(groups, spellings, strict=True)]
    names = {separate(name): group for group, cell in rows for name in (group, *split_cell(cell))}
    together, used_up = (
        frozenset(group for group, flag in zip(groups, column, strict=True) if flag == "yes")
        for column in flags
    )
    return names, together, used_up


@cache
def read_narrow() -> frozenset[str]:
    """Return the labels of rooms that hold only what the table of things names there: a lift."""
    table = read_table("kinds-v1.csv")
    return frozenset(
        kind for kind, holds in zip(table["kind"], table["holds"], strict=True) if holds
    )


@dataclass(frozen=True, eq=False, slots=True)  # each is one: answers look them up by the thousand
class Receptacle:
    """A piece of furniture on or in which things lie."""

    name: str
    like: tuple[int, ...]  # the listed pieces that it is like, numbers of `Shares.pieces`
    closed: float  # share of what it holds that is not seen until it is opened
    only: bool  # whether it holds only what the table of keeping names


@dataclass(frozen=True, slots=True)
class Keeping:
    """Where a person would look for a kind of thing."""

    weights: Mapping[str, float]  # of pieces by name, per cent; none for what stands by itself

    def weigh(self, piece: Receptacle) -> float | None:
        """Return the weight of a piece; None if those that it is like say it."""
        if piece.name in self.weights or piece.only:
            return self.weights.get(piece.name, 0.0)
        return None


@dataclass(frozen=True, eq=False)
class Shares:
    """Shares of people, for K rooms and P listed pieces.

    Attributes:
        rooms: room labels.
        pieces: of furniture.
        belongs: `[K, P]` to whom things belong there, all things together.
        untidy: `[K, P]` who say that they lie there when the home is untidy.
    """

    rooms: tuple[str, ...]
    pieces: tuple[str, ...]
    belongs: Floats
    untidy: Floats


@lru_cache(maxsize=4096)  # the objects of a room are asked again and again
def find_receptacle(word: str) -> Receptacle | None:
    """Return the piece of furniture that a word names; None if things do not lie there.

    >>> [one.name for word in ("Night_Stand", "worktops") if (one := find_receptacle(word))]
    ['nightstand', 'counter']
    >>> find_receptacle("banana") is None
    True
    """
    if len(word) > LONGEST:
        return None
    listed = _read_receptacles()
    keys = map(separate, (word, take_apart(word), *list_parts(word)))
    forms = (form for key in keys for form in (key, *singulars(key)))
    return next((listed[form] for form in forms if form in listed), None)


@lru_cache(maxsize=256)
def find_keeping(word: str) -> Keeping | None:
    """Return where a person would look for a thing; None if the table does not say."""
    listed, words = _read_keeping(), separate(word).split()
    for start in range(len(words)):  # running shoes lie where shoes do
        ending = " ".join(words[start:])
        thing = find_thing(ending)
        for name in (ending, thing.name if thing else ""):
            if name in listed:
                return listed[name]
    return Keeping({}) if find_receptacle(word) else None


@cache
def read_shares() -> Shares:
    """Return the shares of people."""
    table = read_table(_SHARES)  # all pieces of a room, then the next room
    rooms, pieces = (tuple(dict.fromkeys(table[name])) for name in ("room", "receptacle"))
    belongs, untidy = (
        np.array(table[name], dtype=float).reshape(len(rooms), len(pieces))
        for name in ("belongs", "untidy")
    )
    return Shares(rooms, pieces, belongs, untidy)


@cache
def _read_receptacles() -> Mapping[str, Receptacle]:
    number = {piece: index for index, piece in enumerate(read_shares().pieces)}
    rows = zip(*read_table(_PIECES).values(), strict=True)
    found: dict[str, Receptacle] = {}
    for name, spellings, like, opened, only, _ in rows:
        alike = tuple([number[piece] for piece in split_cell(like)])
        piece = Receptacle(name, alike, _OPENED[opened], only == "yes")
        found |= dict.fromkeys(separate_names([name, *split_cell(spellings)]), piece)
    return found


@cache
def _read_keeping() -> Mapping[str, Keeping]:
    table, found = read_table(_KEEPING), dict[str, Keeping]()
    for things, pieces in zip(table["things"], table["receptacles"], strict=True):
        found |= dict.fromkeys(split_cell(things), Keeping(dict(split_weights(pieces))))
    return found
