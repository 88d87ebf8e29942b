"""Say what looks that missed leave of the belief: which things they sought, and what they doubt.

A graph keeps what a robot said: scores of objects, and looks. Here both are weighed, by Bayes'
rule. Of an object with the score s, looks that all miss it with the probability m leave

    s m / (1 − s + s m)

An object that nobody doubted counts as s = 0.8 then: things are moved, and sightings err. Looks at
furniture doubt what is on it; of a thing in the room, on nobody knows what, they miss the other
pieces (`bsg_models.belief.pieces`).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.observation.partial_graph import Look, PartialGraph, SeenObject
from bsg_models.belief.pieces import find_supports, furnish
from bsg_models.robot.words import Meaning

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
        if mine.thing is not None and mine.thing == sought.thing:
            return mine.told <= sought.told
        if mine.noun is not None:
            return sought.noun is not None and mine.noun.includes(sought.word)
        its_class = sought.model, sought.class_index
        return mine.is_class and (mine.model, mine.class_index) == its_class


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


def sum_pieces(looks: Sequence[MissedLook], sought: Meaning, *, node: int) -> MissedPieces:
    """Return what looks have missed of a thing in a room, the last one at the end."""
    covering = [one.look for one in looks if one.covers(sought)]
    missed = _multiply(look for look in covering if look.room_index == node)
    if not covering or covering[-1].room_index != node:
        return MissedPieces(missed)
    return MissedPieces(missed, is_last=True, last=covering[-1].at)


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
    of_rooms: dict[int, list[MissedLook]] = {}
    for one in looks:
        of_rooms.setdefault(one.look.room_index, []).append(one)
    rooms = {node: _Searched(graph, node, some, names) for node, some in of_rooms.items()}
    objects = []
    for obj in graph.objects:
        missed = rooms[obj.room_index].miss(obj) if obj.room_index in rooms else 1.0
        if missed < 1:
            before = _TRUSTED if obj.probability == 1 else obj.probability
            obj = replace(obj, score=before * missed / (1 - before + before * missed))
        if obj.probability > 0:
            objects.append(obj)
    return replace(graph, objects=tuple(objects))


class _Searched:
    """A room in which looks have missed."""

    def __init__(
        self,
        graph: PartialGraph,
        node: int,
        looks: Sequence[MissedLook],
        names: Callable[[Meaning], Callable[[str], bool]],
    ) -> None:
        self._room = graph.rooms[node - 1]
        self._objects = [obj for obj in graph.objects if obj.room_index == node]
        self._on = find_supports(self._objects)
        words = {one.meaning.word: one.meaning for one in looks}
        self._sought = [
            (names(meaning), meaning, _multiply(o.look for o in looks if o.meaning.word == word))
            for word, meaning in words.items()
        ]

    def miss(self, obj: SeenObject) -> float:
        """Return P(all looks miss an object that is there)."""
        missed = 1.0
        for is_sought, meaning, looks in self._sought:
            if is_sought(obj.raw_category):
                missed *= looks.get(None, 1.0) * self._miss_at_pieces(obj, meaning, looks)
        return missed

    def _miss_at_pieces(
        self, obj: SeenObject, meaning: Meaning, looks: Mapping[str | None, float]
    ) -> float:
        """Return P(looks at pieces miss an object); nobody may know on which of them it is."""
        if obj.name in self._on:
            return looks.get(self._on[obj.name], 1.0)
        if looks.keys() <= {None}:
            return 1.0
        none: Floats = np.zeros(0)  # it is on a piece that was seen
        known = furnish(meaning.said, self._room, self._objects, classes=(), unseen=none)
        return 1.0 if known is None else known.overlooked(looks)


def _multiply(looks: Iterable[Look]) -> dict[str | None, float]:
    """Return the piece of a look, None for a whole room → P(all looks there miss)."""
    missed: dict[str | None, float] = {}
    for look in looks:
        missed[look.at] = missed.get(look.at, 1.0) * (1 - look.chance)
    return missed
