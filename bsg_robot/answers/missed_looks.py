"""Say what looks that missed leave of the belief: which things they sought, and what they doubt.

A graph keeps what a robot said: scores of objects, and looks. Here both are weighed, by Bayes'
rule. Of an object with the score s, looks that all miss it with the probability m leave

    s m / (1 − s + s m)

What was seen or looked for some time ago counts less: things move
(`bsg_robot.answers.habits`). An object that nobody doubted counts as s = 0.8 then: things are
moved, and sightings err. Looks at furniture doubt what is on it; of a thing in the room, on nobody
knows what, they miss the other pieces (`bsg_robot.things.pieces`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.partial_graph import KnownRoom, Look, PartialGraph, SeenObject
from bsg_models.search.looks import doubt, miss_all, overlooked_at
from bsg_robot.answers.words import Meaning
from bsg_robot.things.pieces import find_pieces, furnish
from bsg_robot.things.things import find_thing

Chances = Mapping[str | None, tuple[float, ...]]  # piece; None for a whole room → its looks'
TRUSTED = 0.8  # P(a thing is where it was seen without doubt), once a look has missed it


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


def sum_looks(looks: Sequence[MissedLook], sought: Meaning) -> dict[int, Chances]:
    """Return the rooms with looks for a thing → what was looked at there."""
    rooms: dict[int, list[Look]] = defaultdict(list)
    for one in looks:
        if one.covers(sought):
            rooms[one.look.room_index].append(one.look)
    return {node: sum_chances(some) for node, some in rooms.items()}


def sum_chances(looks: Iterable[Look]) -> Chances:
    """Return the piece of looks into a room, None for the whole room → their chances."""
    chances: dict[str | None, tuple[float, ...]] = {}
    for look in looks:
        chances[look.at] = (*chances.get(look.at, ()), look.chance)
    return chances


def missed_by(chances: Chances) -> dict[str | None, float]:
    """Return the piece of looks into a room, None for the whole room → P(all looks there miss)."""
    return {at: miss_all(some, overlooked=overlooked_at(at)) for at, some in chances.items()}


def doubt_objects(
    graph: PartialGraph,
    looks: Sequence[MissedLook],
    *,
    names: Callable[[Meaning], Callable[[str], bool]],
    stayed: Callable[[SeenObject], float],
) -> PartialGraph:
    """Return the graph with the scores that time and looks leave; what cannot be there is left out.

    Args:
        graph: as the robot said it.
        looks: that missed.
        names: meaning → whether a robot's word for an object names such a thing.
        stayed: object → P(it is still where it was seen).
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
        still = stayed(obj)
        if missed < 1:
            before = still * (TRUSTED if obj.probability == 1 else obj.probability)
            obj = replace(obj, score=doubt(before, missed))
        elif still < 1:
            obj = replace(obj, score=still * obj.probability)
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
    seen, every = find_pieces(objects), list(looks)
    is_sought = {one.meaning.word: names(one.meaning) for one in every}

    @cache
    def seek(word: str) -> tuple[str, dict[str | None, float]]:
        """Return what looks for such an object call it, and what they missed."""
        some = [one for one in every if is_sought[one.meaning.word](word)]
        chances = sum_chances(one.look for one in some)
        return some[0].meaning.kept_as if some else word, missed_by(chances)

    @cache
    def miss(word: str, piece: str | None) -> float:
        name, missed = seek(word)
        whole = missed.get(None, 1.0)
        if piece is not None:
            return whole * missed.get(piece, 1.0)
        if missed.keys() <= {None}:
            return whole
        none: Floats = np.zeros(0)  # it is on a piece that was seen
        known = furnish(name, room, seen, classes=(), unseen=none)
        return whole if known is None else whole * known.overlooked(missed)

    return lambda obj: miss(obj.raw_category, seen.on.get(obj.name))
