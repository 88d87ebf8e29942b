"""Say what looks that missed leave of the belief: which things they sought, and what they doubt.

A graph keeps what a robot said: scores of objects, and looks. Here both are weighed, by Bayes'
rule. Of an object with the score s, looks that all miss it with the probability m leave

    s m / (1 − s + s m)

An object that nobody doubted counts as s = 0.8 then: things are moved, and sightings err.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.observation.partial_graph import Look, PartialGraph
from bsg_models.belief.nouns import looks_of
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
            return looks_of(mine.word) <= looks_of(sought.word)
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
    sought: dict[tuple[int, str | None], list[tuple[Callable[[str], bool], float]]] = {}
    for one in looks:
        room = sought.setdefault((one.look.room_index, one.look.at), [])
        room.append((names(one.meaning), 1 - one.look.chance))
    objects = []
    for obj in graph.objects:
        missed = 1.0
        at_it = sought.get((obj.room_index, obj.on), ()) if obj.on is not None else ()
        for is_sought, each in (*sought.get((obj.room_index, None), ()), *at_it):
            missed *= each if is_sought(obj.raw_category) else 1.0
        if missed < 1:
            before = _TRUSTED if obj.probability == 1 else obj.probability
            obj = replace(obj, score=before * missed / (1 - before + before * missed))
        if obj.probability > 0:
            objects.append(obj)
    return replace(graph, objects=tuple(objects))
