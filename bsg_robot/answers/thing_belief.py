"""Define what is believed of one thing: where it was seen, and where it may be hidden."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.belief.count_distribution import CountDistribution, poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import SeenObject
from bsg_models.zoo.building_tilt import tilt_rooms, untilt
from bsg_robot.answers.nouns import Noun, NounTable
from bsg_robot.answers.unknown_rooms import Apart, log_odds

if TYPE_CHECKING:
    from bsg_robot.answers.habits import Usual

_LEAST = 1e-12  # least P(none) of which a logarithm is taken
_ONE = 0.05  # mean of a Poisson of which hardly any count is above 1
_LEAST_TILT = 1e-3  # at 0, rooms exclude each other; so they nearly do
_ROUNDS = 2  # in which the building's mean follows its rooms'
SHARE_OF_KIND = 0.5  # of shoes that are running shoes, and the like


@dataclass(frozen=True, eq=False)
class ThingBelief:
    """Beliefs about one thing at N nodes: the building, its rooms, and those not found yet.

    Attributes:
        seen: the objects of this kind that were seen at each node; the building's are in no room.
        hidden: hidden counts at each node, `[K, N, 1]`; those of the building are not used.
        none: P(the building hides none).
        searched: `[N]` nodes where a look finds nothing more.
        new: `[N]` share of the hidden that were never seen there: the others were seen some time
            ago, and may have moved.
    """

    seen: tuple[tuple[SeenObject, ...], ...]
    hidden: CountDistribution
    none: float
    searched: Bools
    new: Floats

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
    def tilt(self) -> float:
        """Z of the law of a search: see `bsg_models.search.problem`."""
        rooms, whole = self.probability[1:], self.probability[:1]
        if not len(rooms):
            return 1.0
        whole = whole.clip(rooms.max(), rooms.sum())
        return max(_LEAST_TILT, float(untilt(rooms[:, None], whole)[0]))

    @property
    def never_seen(self) -> Floats:
        """P(at least one that was never seen there), `[N]`."""
        return np.asarray(self.unseen * self.new)

    @cached_property
    def expected(self) -> Floats:
        """Expected number of those that were never seen, `[N]`."""
        return np.asarray(self.hidden.mean[:, 0] * self.new)

    @property
    def is_sure(self) -> Bools:
        """Whether one was seen at a node, and nobody doubts it, `[N]`; the building is none."""
        sure: Bools = self._score == 1
        sure[0] = False
        return sure

    def finds(self, chances: Floats, *, unsure: bool = False) -> Floats:
        """Return P(a look finds at least one) at each node, `[N]`; 0 of the building.

        Args:
            chances: `[N]` P(a look finds an object that is there).
            unsure: whether only those count of which it is not sure that they are there.
        """
        missed = 1 - self.finds_unseen(chances, np.arange(len(self.seen)))
        for node, objects in enumerate(self.seen):
            counted = [obj for obj in objects if not unsure or obj.probability < 1]
            missed[node] *= _miss(counted, chances[node])
        missed[0] = 1.0
        return np.asarray(1 - missed)

    def finds_unseen(self, chances: Floats, nodes: Ints) -> Floats:
        """Return P(a look at some nodes finds at least one that was not seen), `[M]`."""
        missed = self.hidden.take(nodes).miss(chances[:, None])[:, 0]
        return np.asarray(1 - np.where(self.searched[nodes], 1.0, missed))

    def somewhere(self, nodes: slice) -> float:
        """Return P(some rooms have at least one that was not seen), no more than the building's."""
        return min(float(self.unseen[0]), 1 - float(np.prod(1 - self.unseen[nodes])))

    def after(self, chances: Floats) -> ThingBelief:
        """Return the beliefs after looks that missed, `[N]` chances; see `missed`.

        The objects that were seen have lost their scores already.
        """
        if not chances.any():
            return self
        after, none = _look(self.hidden, chances[:, None], whole=np.array([1 - self.none]))
        return ThingBelief(self.seen, after, float(none[0]), self.searched, self.new)


def after_looks(hidden: CountDistribution, chances: Floats) -> CountDistribution:
    """Return hidden counts after looks that missed, by node and class `[N, C]`, building first."""
    after, none = _look(hidden, chances, whole=hidden.presence[0])
    factor = np.zeros(chances.shape)
    factor[0] = log_odds(none) - log_odds(1 - hidden.presence[0])
    return after.with_none_likelier(factor)


def lift(belief: Apart, rates: Floats, *, weight: Floats, least: Floats) -> CountDistribution:
    """Return hidden counts on the scale of what a person would find.

    The log odds of a group of rooms are mixed with those by the rates of homes, and its rooms are
    tilted to them (`bsg_models.zoo.building_tilt`). Beside known rooms, those of which nothing is
    known have the rates of homes alone: a model does not hear which kinds of rooms are missing.
    Then no node is less likely than `least`.

    Args:
        belief: of N nodes and C classes.
        rates: `[N, C]` mean numbers by the table of things.
        weight: `[C]` of them in known rooms, 0 to 1.
        least: `[N, C]` P(at least one) of what each class includes.
    """
    hidden = belief.every.hidden_counts
    odds = log_odds(1 - hidden.presence)
    tilts, whole = np.zeros(odds.shape), np.ones(odds.shape[1])
    weights = weight, (weight > 0).astype(np.float64)  # of known rooms, and of the others
    for nodes, none, mixed in zip(belief.nodes, belief.none, weights, strict=False):
        # A network may say less of the building than of one of its rooms.
        none = np.minimum(none, (1 - hidden.presence[nodes]).min(axis=0, initial=1.0))
        homes = np.exp(-(rates[nodes] if len(nodes) else rates).sum(axis=0))
        tilt = mixed * (log_odds(homes) - log_odds(none))
        alone = np.log((1 - hidden.presence[nodes]).clip(min=_LEAST))
        tilts[nodes] = tilt_rooms(tilt, alone.sum(axis=0), alone)
        whole *= 1 / (1 + np.exp(-log_odds(none) - tilt))
    after = np.vstack([log_odds(whole), (odds + tilts)[1:]])
    after = np.minimum(after, log_odds(1 - least))
    after[0] = after.min(axis=0)
    factor = np.where(hidden.presence > 0, after - odds, 0.0)
    return hidden.with_none_likelier(factor)


def count_rooms(hidden: CountDistribution) -> CountDistribution:
    """Return hidden counts of which the building expects what its rooms do; P(none) stays.

    `hidden` is of N nodes, the building first.
    """
    none = log_odds(1 - hidden.presence[0])
    for _ in range(_ROUNDS if len(hidden.mean) > 1 else 0):
        means = hidden.means.copy()
        means[:, 0] *= hidden.mean[1:].sum(axis=0) / hidden.mean[0].clip(min=_LEAST)
        hidden = replace(hidden, means=means)
        factor = np.zeros(hidden.presence.shape)
        factor[0] = np.where(hidden.presence[0] > 0, none - log_odds(1 - hidden.presence[0]), 0.0)
        hidden = hidden.with_none_likelier(factor)
    return hidden


def _look(
    hidden: CountDistribution, chances: Floats, *, whole: Floats
) -> tuple[CountDistribution, Floats]:
    """Return hidden counts after looks that missed, and P(none) of the building, `[A]`.

    Looks change the rooms as if they were independent; the tilt of the building stays
    (`bsg_models.zoo.building_tilt`).

    Args:
        hidden: of N nodes and A classes; the row of the building is not changed.
        chances: `[N, A]` of finding an object at a node; that of the building does not count.
        whole: `[A]` P(at least one) of the building.
    """
    rooms = chances.copy()
    rooms[0] = 0.0
    missed, after = hidden.miss(rooms)[1:], hidden.missed(rooms)
    presence = hidden.presence[1:]
    whole = whole.clip(presence.max(axis=0, initial=0.0), presence.sum(axis=0))
    scale = untilt(presence, whole)
    given = np.divide(  # P(a look misses, if there is one)
        missed - (1 - presence), presence, out=np.ones_like(presence), where=presence > 0
    ).clip(0.0, 1.0)
    some = scale * presence
    tilt = log_odds(1 - whole) - log_odds(1 - scale * whole)
    log_none = np.log((1 - some).clip(min=_LEAST) / (1 - some + some * given).clip(min=_LEAST))
    every = log_none.sum(axis=0)
    odds = log_odds(np.exp(log_none)) + tilt_rooms(tilt, every, log_none)
    factor = np.zeros(chances.shape)
    factor[1:] = np.where(presence > 0, odds - log_odds(1 - after.presence[1:]), 0.0)
    none = 1 / (1 + np.exp(-log_odds(np.exp(every)) - tilt))
    return after.with_none_likelier(factor), none


def _miss(objects: Sequence[SeenObject], chance: float) -> float:
    """Return P(a look finds none of the objects)."""
    return math.prod([1 - chance * obj.probability for obj in objects])


def believe_noun(
    noun: Noun, belief: Expectation, nouns: NounTable
) -> tuple[CountDistribution, float]:
    """Return the hidden counts of a noun, and P(the building hides none), rooms independent."""
    counts = nouns.expect(noun, belief)
    return counts, _none_of_rooms(counts)


def believe_rates(rates: Floats, *, part: float = 1.0) -> tuple[CountDistribution, float]:
    """Return the hidden counts of an everyday thing, and P(the building hides none).

    Args:
        rates: `[N]` mean numbers, of `rate_things`; the building's may be less than its rooms'.
        part: share of such things that are of the kind that is sought.
    """
    counts = poisson(part * rates[:, None])
    return counts, max(_none_of_rooms(counts), float(np.exp(-part * rates[0])))


def believe_kind(
    counted: CountDistribution, judged: CountDistribution
) -> tuple[CountDistribution, float]:
    """Return the hidden counts of a kind of a class's things: a geometric mean of two beliefs.

    The class is counted but wider; the noun is exact but judged by its meaning alone. A kind is
    never likelier than its class.
    """
    rates = [-np.log1p(-np.minimum(counts.presence, 1 - _LEAST)) for counts in (counted, judged)]
    rate = np.minimum(np.sqrt(rates[0] * rates[1]), rates[0])
    counts = poisson(rate)
    return counts, max(_none_of_rooms(counts), 1 - float(counted.presence[0, 0]))


def believe_usual(
    counts: CountDistribution, none: float, usual: Usual, *, is_class: bool
) -> tuple[CountDistribution, float]:
    """Return the hidden counts that this home has taught, and P(the building hides none).

    Args:
        counts: of N nodes without what it has taught.
        none: P(the building hides none), without it.
        usual: where such things usually are.
        is_class: whether a model counts them: then numbers keep their distribution.
    """
    before = 1 - counts.presence[:, 0]
    alone = before[1:].prod()
    # What is known of the building beside its rooms stays.
    whole = float(usual.none[0] * max(none, _LEAST) / max(alone, _LEAST))
    whole = min(whole, float(usual.none[1:].min(initial=1.0)))
    if is_class and not ((before == 1) & (usual.none < 1)).any():
        odds = log_odds(usual.none) - log_odds(before)
        odds[0] = log_odds(np.array(whole)) - log_odds(before[:1])[0]
        factor = np.where(counts.presence > 0, odds[:, None], 0.0)
        return counts.with_none_likelier(factor), whole
    # Of what was seen, each is one; a small mean with a tilt says so.
    means = -np.log(usual.none.clip(min=_LEAST))
    ones = poisson((means.clip(max=_ONE) if usual.names else means)[:, None])
    odds = log_odds(usual.none[:, None]) - log_odds(1 - ones.presence)
    return ones.with_none_likelier(np.where(usual.none[:, None] < 1, odds, 0.0)), whole


def _none_of_rooms(counts: CountDistribution) -> float:
    none = 1 - counts.presence[:, 0]
    return float(none[1:].prod() if len(none) > 1 else none[0])
