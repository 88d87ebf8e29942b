"""Define what is believed of one thing: where it was seen, and where it may be hidden."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.observation.partial_graph import PartialGraph, SeenObject
from bsg_models.belief.count_distribution import CountDistribution, poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.nouns import Noun, NounTable

_LEAST = 1e-12  # least P(none) of which a logarithm is taken


@dataclass(frozen=True, eq=False)
class ThingBelief:
    """Beliefs about one thing at N nodes: the building, its rooms, and those not found yet.

    Attributes:
        seen: the objects of this kind that were seen at each node; the building's are in no room.
        hidden: hidden counts at each node, `[K, N, 1]`; those of the building are not used.
        none: P(the building hides none).
        searched: `[N]` nodes where a look finds nothing more.
    """

    seen: tuple[tuple[SeenObject, ...], ...]
    hidden: CountDistribution
    none: float
    searched: Bools

    @cached_property
    def _score(self) -> Floats:
        """P(one that was seen at a node is there), `[N]`."""
        return np.array([1 - _miss(objects, 1.0) for objects in self.seen])

    @cached_property
    def unseen(self) -> Floats:
        """P(at least one that was not seen), `[N]`, the building first."""
        unseen = self.hidden.presence[:, 0].copy()
        unseen[0] = 1 - self.none
        return unseen

    @cached_property
    def probability(self) -> Floats:
        """P(at least one), seen or not, `[N]`, the building first."""
        both = 1 - (1 - self._score) * (1 - self.unseen)
        here = np.where(self._score > 0, both, self.unseen)
        seen = [obj for objects in self.seen for obj in objects]
        here[0] = max(1 - self.none * _miss(seen, 1.0), here[1:].max(initial=0.0))
        return here

    @cached_property
    def expected(self) -> Floats:
        """Expected number of those that were not seen, `[N]`."""
        return self.hidden.mean[:, 0]

    @property
    def is_sure(self) -> Bools:
        """Whether one was seen at a node, and nobody doubts it, `[N]`; the building is none."""
        sure: Bools = self._score == 1
        sure[0] = False
        return sure

    def finds(self, chance: float, *, unsure: bool = False) -> Floats:
        """Return P(a look finds at least one) at each node, `[N]`; 0 of the building.

        Args:
            chance: P(a look finds an object that is there).
            unsure: whether only those count of which it is not sure that they are there.
        """
        same = np.full((len(self.seen), 1), chance)
        missed = np.where(self.searched, 1.0, self.hidden.miss(same)[:, 0])
        for node, objects in enumerate(self.seen):
            counted = [obj for obj in objects if not unsure or obj.probability < 1]
            missed[node] *= _miss(counted, chance)
        missed[0] = 1.0
        return np.asarray(1 - missed)

    def after(self, chances: Floats) -> ThingBelief:
        """Return the beliefs after looks that missed, `[N]` chances; see `missed`.

        The objects that were seen have lost their scores already.
        """
        if not chances.any():
            return self
        missed = chances[:, None]
        kept = self.hidden.missed(missed)
        # The building hides none with P(none) / P(the looks miss), if rooms are independent.
        missing = self.hidden.miss(missed)[1:, 0].clip(min=_LEAST)
        none = float(min(1.0, self.none / missing.prod()))
        return ThingBelief(self.seen, kept, none, self.searched)


def _miss(objects: Sequence[SeenObject], chance: float) -> float:
    """Return P(a look finds none of the objects)."""
    return float(np.prod([1 - chance * obj.probability for obj in objects]))


def believe_class(belief: Expectation, column: int) -> tuple[CountDistribution, float]:
    """Return the hidden counts of a class, and P(the building hides none).

    The building is never less likely to hide one than its likeliest room.
    """
    columns = np.full((len(belief.inputs), 1), column)
    counts = belief.hidden_counts.take_classes(columns)
    none = 1 - counts.presence[:, 0]
    return counts, float(none.min())


def believe_noun(
    noun: Noun, belief: Expectation, nouns: NounTable
) -> tuple[CountDistribution, float]:
    """Return the hidden counts of a noun, and P(the building hides none), rooms independent."""
    counts = nouns.expect(noun, belief)
    return counts, _none_of_rooms(counts)


def believe_kind(
    counted: CountDistribution, judged: CountDistribution
) -> tuple[CountDistribution, float]:
    """Return the hidden counts of a kind of a class's things: a geometric mean of two beliefs.

    The class is counted but wider; the noun is exact but judged by its meaning alone. A kind is
    never likelier than its class.
    """
    rates = [-np.log1p(-np.minimum(one.presence, 1 - _LEAST)) for one in (counted, judged)]
    rate = np.minimum(np.sqrt(rates[0] * rates[1]), rates[0])

    counts = poisson(rate)
    return counts, _none_of_rooms(counts)


def _none_of_rooms(counts: CountDistribution) -> float:
    none = 1 - counts.presence[:, 0]
    return float(none[1:].prod() if len(none) > 1 else none[0])


def list_searched(graph: PartialGraph) -> Bools:
    """Return the nodes where a look finds nothing more, `[1 + R]`; the building is one."""
    return np.array([True, *(room.hidden_share == 0 for room in graph.rooms)])
