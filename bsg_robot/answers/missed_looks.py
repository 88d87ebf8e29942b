"""Say what looks that missed leave of the belief: which things they sought, and what they doubt.

A graph keeps what a robot said: scores of objects, and looks. Here both are weighed, by Bayes'
rule. Of an object with the score s, looks that all miss it with the probability m leave

    s m / (1 − s + s m)

An object that nobody doubted counts as s = 0.8 then: things are moved, and sightings err. Looks at
furniture doubt what is on it; of a thing in the room, on nobody knows what, they miss the other
pieces (`bsg_robot.things.pieces`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_models.belief.partial_graph import KnownRoom, Look, PartialGraph, SeenObject
from bsg_robot.answers.words import Meaning
from bsg_robot.things.pieces import find_pieces, furnish
from bsg_robot.things.things import find_thing

_TRUSTED = 0.8  # P(a thing is where it was seen without doubt), once a look has missed it


@dataclass(frozen=True, slots=True)
class MissedLook:
    """A look that did not find a thing, and what the thing's word means."""

    look: Look
    meaning: Meaning

    def covers(self, sought: Meaning) -> bool:
        """Return whether it would have found another thing, too.

        A look for mugs finds red mugs, and one for tableware finds mugs; none finds the rest of a
        wider class.
        """
        mine = self.meaning
        if mine.thing and sought.thing and mine.thing.name == sought.thing.name:
            return mine.told <= sought.told
        if _includes(mine, sought):
            return True
        if mine.noun is not None:
            return sought.noun is not None and mine.noun.includes(sought.word)
        return mine.is_class and mine.class_index == sought.class_index


def _includes(whole: Meaning, sought: Meaning) -> bool:
    """Return whether the table of things has what is sought as a part: boots are shoes."""
    part = sought.thing or find_thing(sought.class_name or "")
    if part is None or whole.told or not (whole.thing or whole.is_class):
        return False
    return part.wider in (whole.thing.names if whole.thing else (whole.class_name,))


@dataclass(frozen=True, eq=False)
class Looked:
    """What looks for a thing have missed at N nodes.

    Attributes:
        missed: `[N]` P(all looks miss a thing that is there); 1 without a look.
        again: `[N]` whether the last look was there.
    """

    missed: Floats
    again: Bools


def sum_looks(looks: Sequence[MissedLook], sought: Meaning, *, nodes: int) -> Looked:
    """Return what looks into whole rooms, the last one at the end, have missed of a thing."""
    missed, again = np.ones(nodes), np.zeros(nodes, dtype=bool)
    covering = [one.look for one in looks if one.look.at is None and one.covers(sought)]
    for one in covering:
        missed[one.room_index] *= 1 - one.chance
    if covering:
        again[covering[-1].room_index] = True
    return Looked(missed, again)


@dataclass(frozen=True, eq=False)
class MissedPieces:
    """What looks for a thing have missed in one room.

    Attributes:
        of_pieces: id of a piece with a look → P(all looks at it miss a thing that is there); None
            for looks into the whole room.
        is_last: whether the last look was in this room.
        last: the piece of the last look; None for the whole room.
    """

    of_pieces: Mapping[str | None, float]
    is_last: bool = False
    last: str | None = None


def sum_pieces(looks: Sequence[MissedLook], sought: Meaning) -> dict[int, MissedPieces]:
    """Return the rooms with looks for a thing → what these missed, the last one at the end."""
    covering = [one.look for one in looks if one.covers(sought)]
    rooms: dict[int, list[Look]] = {}
    for look in covering:
        rooms.setdefault(look.room_index, []).append(look)
    found = {node: MissedPieces(_multiply(some)) for node, some in rooms.items()}
    if covering:
        node = covering[-1].room_index
        found[node] = replace(found[node], is_last=True, last=covering[-1].at)
    return found


def doubt_objects(
    graph: PartialGraph,
    looks: Sequence[MissedLook],
    *,
    names: Callable[[Meaning], Callable[[str], bool]],
) -> PartialGraph:
    """Return the graph with the scores that looks leave; what cannot be there is left out.

    Args:
        graph: as the robot said it.
        looks: that missed.
        names: meaning → whether a robot's word for an object names such a thing.
    """
    looked, inside = defaultdict(list), defaultdict(list)
    for one in looks:
        looked[one.look.room_index].append(one)
    for obj in graph.objects:
        inside[obj.room_index].append(obj)
    miss = {
        node: _doubt_room(graph.rooms[node - 1], inside[node], some, names=names)
        for node, some in looked.items()
    }
    objects = []
    for obj in graph.objects:
        missed = miss[obj.room_index](obj) if obj.room_index in miss else 1.0
        if missed < 1:
            before = _TRUSTED if obj.probability == 1 else obj.probability
            obj = replace(obj, score=before * missed / (1 - before + before * missed))
        if obj.probability > 0:
            objects.append(obj)
    return replace(graph, objects=tuple(objects))


def _doubt_room(
    room: KnownRoom,
    objects: Iterable[SeenObject],
    looks: Iterable[MissedLook],
    *,
    names: Callable[[Meaning], Callable[[str], bool]],
) -> Callable[[SeenObject], float]:
    """Return P(all looks into a room miss an object that is there), a function of the object.

    Of each word that was seen there, it decides once.
    """
    seen, words = find_pieces(objects), defaultdict(list)
    for one in looks:
        words[one.meaning.word].append(one)
    sought = [
        (some[0].meaning, names(some[0].meaning), _multiply(one.look for one in some))
        for some in words.values()
    ]

    @cache
    def miss_somewhere(number: int) -> float:
        """Return P(looks for a word miss what is on any piece)."""
        meaning, _, missed = sought[number]
        if missed.keys() <= {None}:
            return 1.0
        none: Floats = np.zeros(0)  # it is on a piece that was seen
        known = furnish(meaning.kept_as, room, seen, classes=(), unseen=none)
        return 1.0 if known is None else known.overlooked(missed)

    @cache
    def find_sought(word: str) -> list[int]:
        return [number for number, (_, is_sought, _) in enumerate(sought) if is_sought(word)]

    @cache
    def miss(word: str, piece: str | None) -> float:
        left = 1.0
        for number in find_sought(word):
            missed = sought[number][2]
            at_piece = miss_somewhere(number) if piece is None else missed.get(piece, 1.0)
            left *= missed.get(None, 1.0) * at_piece
        return left

    return lambda obj: miss(obj.raw_category, seen.on.get(obj.name))


def _multiply(looks: Iterable[Look]) -> dict[str | None, float]:
    """Return the piece of a look, None for a whole room → P(all looks there miss)."""
    missed: dict[str | None, float] = {}
    for look in looks:
        missed[look.at] = missed.get(look.at, 1.0) * (1 - look.chance)
    return missed
