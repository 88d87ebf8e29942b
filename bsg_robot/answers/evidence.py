"""Weigh the evidence of a graph: what looks that missed, and time, leave of what a robot has seen.

A graph keeps what a robot said: scores of objects, and looks. Here both are weighed, by Bayes' rule
(`bsg_models.search.looks`). What was seen or looked for some time ago counts less: things move
(`bsg_robot.answers.habits`). An object that nobody doubted counts as s = 0.8 then: things are
moved, and sightings err. Looks at furniture doubt what is on it; of a thing in the room, on nobody
knows what, they miss the other pieces (`bsg_robot.things.pieces`).
"""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.clock import HOUR, has_stayed
from bsg_models.belief.partial_graph import KnownRoom, Look, PartialGraph, SeenObject
from bsg_models.search.looks import doubt, miss_all, overlooked_at
from bsg_robot.answers.dictionary import Dictionary
from bsg_robot.answers.words import Meaning
from bsg_robot.things.pieces import find_pieces, furnish
from bsg_robot.things.things import find_thing

Chances = Mapping[str | None, tuple[float, ...]]  # piece; None for a whole room → its looks'
_STAYED = 0.99  # P(a thing is where it was just seen) that nobody doubts
TRUSTED = 0.8  # P(a thing is where it was seen without doubt), once a look has missed it


@dataclass(frozen=True, slots=True)
class Miss:
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


def sum_looks(misses: Sequence[Miss], sought: Meaning) -> dict[int, Chances]:
    """Return the rooms with looks for a thing → what was looked at there."""
    rooms: dict[int, list[Look]] = defaultdict(list)
    for miss in misses:
        if miss.covers(sought):
            rooms[miss.look.room_index].append(miss.look)
    return {node: _sum_chances(some) for node, some in rooms.items()}


def _sum_chances(looks: Iterable[Look]) -> Chances:
    """Return the piece of looks into a room, None for the whole room → their chances."""
    chances: dict[str | None, tuple[float, ...]] = {}
    for look in looks:
        chances[look.at] = (*chances.get(look.at, ()), look.chance)
    return chances


def missed_by(chances: Chances) -> dict[str | None, float]:
    """Return the piece of looks into a room, None for the whole room → P(all looks there miss)."""
    return {at: miss_all(some, overlooked=overlooked_at(at)) for at, some in chances.items()}


def weigh_evidence(graph: PartialGraph, words: Dictionary) -> tuple[tuple[Miss, ...], PartialGraph]:
    """Return the looks for known things, as time leaves them, and what both leave of the objects.

    Of objects, that is their scores; those that cannot be there are left out.
    """
    misses = []
    for look in graph.looks:
        if meaning := words.look_up(look.thing):
            stayed = has_stayed(look.time, graph.now, graph.stays or words.stays(meaning))
            misses.append(Miss(replace(look, chance=look.chance * stayed), meaning))
    objects: Iterable[SeenObject] = graph.objects
    if misses or graph.now is not None:
        objects = _doubt_objects(graph, misses, words)
    likely = tuple([obj for obj in objects if obj.probability > 0])
    return tuple(misses), replace(graph, objects=likely)


def _doubt_objects(
    graph: PartialGraph, misses: Sequence[Miss], words: Dictionary
) -> Iterator[SeenObject]:
    """Yield the objects with the scores that looks and time leave."""
    looked, inside = defaultdict(list), defaultdict(list)
    for miss in misses:
        looked[miss.look.room_index].append(miss)
    for obj in graph.objects:
        inside[obj.room_index].append(obj)
    miss_in = {
        node: _doubt_room(graph.rooms[node - 1], inside[node], some, names=words.names)
        for node, some in looked.items()
    }
    stayed = remember_stays(graph, words)
    for obj in graph.objects:
        missed = miss_in[obj.room_index](obj) if obj.room_index in miss_in else 1.0
        still = stayed(obj)
        if missed < 1 or still < 1:
            trust = TRUSTED if missed < 1 and obj.probability == 1 else obj.probability
            obj = replace(obj, score=doubt(still * trust, missed))
        yield obj


def remember_stays(graph: PartialGraph, words: Dictionary) -> Callable[[SeenObject], float]:
    """Return object → P(it is where it was seen), by what this home remembers of it."""
    from bsg_robot.answers.habits import has_rested  # only with a clock

    memory = {known.name: known for known in graph.memory}

    def stay(obj: SeenObject) -> float:
        if obj.time is None or graph.now is None:
            return 1.0
        given = obj.stays or graph.stays
        stays = words.staying(given)(obj.raw_category)
        stayed = has_stayed(obj.time, graph.now, stays)
        if given is None:
            before = memory[obj.name].sightings if obj.name in memory else ()
            elsewhere = sum(sight[1:] != (obj.room_index, obj.on) for sight in before)
            stayed = has_rested(stayed, (graph.now - obj.time) / HOUR, stays, elsewhere=elsewhere)
        return stayed if stayed < _STAYED else 1.0

    return stay


def _doubt_room(
    room: KnownRoom,
    objects: Iterable[SeenObject],
    misses: Iterable[Miss],
    *,
    names: Callable[[Meaning], Callable[[str], bool]],
) -> Callable[[SeenObject], float]:
    """Return P(all looks into a room miss an object that is there), a function of the object.

    Of each word that was seen there, it decides once.
    """
    seen, every = find_pieces(objects), list(misses)
    is_sought = {miss.meaning.word: names(miss.meaning) for miss in every}

    @cache
    def seek(word: str) -> tuple[str, dict[str | None, float]]:
        """Return what looks for such an object call it, and what they missed."""
        some = [miss for miss in every if is_sought[miss.meaning.word](word)]
        chances = _sum_chances(miss.look for miss in some)
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
