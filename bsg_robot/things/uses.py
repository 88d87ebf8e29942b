"""What the words before a thing say of the rooms where it is: a patio table is on the patio.

A word may name a use (`tables/uses-v1.csv`: `words,rooms`, written by hand), a kind of room, or
another thing. A row without rooms has words that say nothing of them: a paper bag is a bag.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cache, lru_cache

from bsg_data.scene.room_label import read_room
from bsg_data.words.normal import LONGEST, singulars
from bsg_robot.tables.table import read_table, split_cell, split_weights
from bsg_robot.things.things import Thing, find_thing

_FILE = "uses-v1.csv"
_SHORTEST = 3  # letters of a word that names a room
# Shares of a thing that are where a use or a room says, and where another thing is.
_SAID, _BESIDE = 0.8, 0.5
_ELSEWHERE = 0.1  # share of a thing that a room of its use has, though such things are not there


@dataclass(frozen=True, slots=True)
class Use:
    """Where the things are that are called by a word.

    Attributes:
        rooms: common labels with their shares, which add up to 1.
        share: of such things that are there.
    """

    rooms: tuple[tuple[str, float], ...]
    share: float


@lru_cache(maxsize=4096)  # the objects of a map are asked again and again
def find_use(word: str, *, by_thing: bool = True) -> Use | None:
    """Return what a word before a thing says of its rooms; None if it says nothing.

    `by_thing`: whether the word may name another thing.

    >>> [use.rooms[0][0] for word in ("curio", "kitchen") if (use := find_use(word))]
    ['living room', 'kitchen']
    >>> find_use("paper") is None
    True
    """
    if len(word) > LONGEST:
        return None
    listed = _read_uses()
    for form in (word, *singulars(word)):
        if form in listed:
            return listed[form]
    read = read_room(word) if len(word) >= _SHORTEST else None
    if read is not None and read.label is not None and read.rule is None:
        return Use(((read.label, 1.0),), _SAID)
    thing = find_thing(word) if by_thing else None
    return None if thing is None else Use(thing.rooms, _BESIDE)


def move_thing(thing: Thing, words: Iterable[str]) -> Thing:
    """Return a thing in the rooms that the words before its name tell, the last word first.

    The share of a room is the product of the use's and the thing's; what is left stays where such
    things are. So a word that both rooms agree with sharpens, and the use wins where they differ.
    """
    for word in reversed([*words]):
        if use := find_use(word):
            usual = dict(thing.rooms)
            both = {
                room: share * (thing.probability_in(room) + _ELSEWHERE) for room, share in use.rooms
            }
            total, left = math.fsum(both.values()), 1 - use.share
            shares = {
                room: use.share * both.get(room, 0.0) / total + left * usual.get(room, 0.0)
                for room in dict.fromkeys((*both, *usual))
            }
            thing = replace(
                thing, rooms=tuple(sorted(shares.items(), key=lambda share: (-share[1], share[0])))
            )
    return thing


@cache
def _read_uses() -> Mapping[str, Use | None]:
    found: dict[str, Use | None] = {}
    for words, rooms in zip(*read_table(_FILE).values(), strict=True):
        weights = dict(split_weights(rooms))
        total = math.fsum(weights.values())
        shares = tuple((room, weight / total) for room, weight in weights.items())
        found |= dict.fromkeys(split_cell(words), Use(shares, _SAID) if shares else None)
    return found
