"""Define what is believed of one thing: where it was seen, and where it may be hidden."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject
from bsg_data.scene.things import Thing
from bsg_models.belief.count_distribution import CountDistribution, poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.robot.nouns import Noun, NounTable
from bsg_models.zoo.building_tilt import tilt_rooms, untilt

_LEAST = 1e-12  # least P(none) of which a logarithm is taken
# Share of things that are in sight: most annotators see those that are a class of their own.
_OF_SMALL, _OF_LARGE = 0.5, 0.9
_KINDS = 8  # kinds of rooms in a home
_LEAST_LEFT = 0.05  # least share of a thing for rooms of unknown kind
_ANYWHERE = 0.03  # share of a thing that is in any room
_WHOLE = 0.5  # rooms whose kinds have less of a thing are not all of a building
# Where people search if a building has no room of a kind.
_STANDS_IN = {
    "closet": ("bedroom", "corridor"),
    "copy room": ("printer room", "office"),
    "corridor": ("entrance", "lobby"),
    "dining room": ("kitchen", "living room"),
    "entrance": ("corridor", "lobby"),
    "garage": ("storage room", "utility room"),
    "laundry room": ("utility room", "bathroom", "kitchen"),
    "office": ("living room", "bedroom"),
    "pantry": ("kitchen",),
    "pharmacy": ("medication room", "infirmary"),
    "playroom": ("bedroom",),
    "storage room": ("utility room", "closet", "garage"),
    "toilet": ("bathroom",),
    "bathroom": ("toilet",),
    "utility room": ("laundry room", "storage room", "kitchen"),
}
_ROOMS_OF = {
    "hospital": (
        *("patient room", "infirmary", "examination room", "operating room", "imaging room"),
        *("pharmacy", "waiting room"),
    ),
    "office": ("office", "meeting room", "copy room", "computer room", "conference hall"),
    "school": ("classroom", "library", "laboratory", "computer room"),
    "restaurant": ("restaurant", "bar", "kitchen"),
    "shop": ("shop",),
    "hotel": ("bedroom", "bathroom", "lobby"),
}
_OURS, _ELSEWHERE = 0.15, 0.95  # share of these rooms of which a thing is in such a building
SHARE_OF_KIND = 0.5  # of shoes that are running shoes, and the like
_MOST_HOMES = 0.995  # P(a home has one); in a table, 99 % is a round number


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
        missed = 1 - self.finds_unseen(chance)
        for node, objects in enumerate(self.seen):
            counted = [obj for obj in objects if not unsure or obj.probability < 1]
            missed[node] *= _miss(counted, chance)
        missed[0] = 1.0
        return np.asarray(1 - missed)

    def finds_unseen(self, chance: float) -> Floats:
        """Return P(a look finds at least one that was not seen), `[N]`."""
        same = np.full((len(self.seen), 1), chance)
        return np.asarray(1 - np.where(self.searched, 1.0, self.hidden.miss(same)[:, 0]))

    def somewhere(self, nodes: slice) -> float:
        """Return P(some rooms have at least one that was not seen), rooms being tilted."""
        rooms, whole = self.unseen[1:, None], self.unseen[:1]
        scale = untilt(rooms, whole.clip(rooms.max(axis=0), rooms.sum(axis=0)))
        none = 1 - scale * self.unseen[nodes]
        both = np.log(none.clip(min=_LEAST)).sum()
        every = np.log((1 - scale * rooms).clip(min=_LEAST)).sum()
        return float(np.clip(whole - (np.exp(both) - np.exp(every)) / scale, 0.0, 1.0)[0])

    def after(self, chances: Floats) -> ThingBelief:
        """Return the beliefs after looks that missed, `[N]` chances; see `missed`.

        The objects that were seen have lost their scores already.
        """
        if not chances.any():
            return self
        after, none = _look(self.hidden, chances[:, None], whole=np.array([1 - self.none]))
        return ThingBelief(self.seen, after, float(none[0]), self.searched)


def after_looks(hidden: CountDistribution, chances: Floats) -> CountDistribution:
    """Return hidden counts after looks that missed, by node and class `[N, C]`, building first."""
    after, none = _look(hidden, chances, whole=hidden.presence[0])
    factor = np.zeros(chances.shape)
    factor[0] = _log_odds(none) - _log_odds(1 - hidden.presence[0])
    return after.with_none_likelier(factor)


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
    there = hidden.presence[1:]
    whole = whole.clip(there.max(axis=0, initial=0.0), there.sum(axis=0))
    scale = untilt(there, whole)
    given = np.divide(  # P(a look misses, if there is one)
        missed - (1 - there), there, out=np.ones_like(there), where=there > 0
    ).clip(0.0, 1.0)
    some = scale * there
    tilt = _log_odds(1 - whole) - _log_odds(1 - scale * whole)
    log_none = np.log((1 - some).clip(min=_LEAST) / (1 - some + some * given).clip(min=_LEAST))
    every = log_none.sum(axis=0)
    odds = _log_odds(np.exp(log_none)) + tilt_rooms(tilt, every, log_none)
    factor = np.zeros(chances.shape)
    factor[1:] = np.where(there > 0, odds - _log_odds(1 - after.presence[1:]), 0.0)
    none = 1 / (1 + np.exp(-_log_odds(np.exp(every)) - tilt))
    return after.with_none_likelier(factor), none


def _log_odds(probability: Floats) -> Floats:
    certain = probability.clip(_LEAST, 1 - _LEAST)
    return np.asarray(np.log(certain) - np.log1p(-certain))


def _miss(objects: Sequence[SeenObject], chance: float) -> float:
    """Return P(a look finds none of the objects)."""
    return math.prod([1 - chance * obj.probability for obj in objects])


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


def believe_thing(
    thing: Thing, graph: PartialGraph, *, likeness: Floats | None, part: float = 1.0
) -> tuple[CountDistribution, float]:
    """Return the hidden counts of an everyday thing, and P(the building hides none).

    The table of everyday things says in which kinds of rooms people search for it, and how many
    homes have one. A building has Λ = −log(1 − P(a home has one)) of them in the mean. They are
    spread over its rooms by the shares of their kinds; what the kinds that are not there would have
    goes to the rooms of unknown kind, by `likeness`. The part of a room that was seen had none in
    sight, and half of such things lie in drawers or behind others; a searched room has none.

    Args:
        thing: of the table.
        graph: with R rooms.
        likeness: `[1 + R]` rates of the thing by what its name means, for rooms of unknown kind;
            None if all are alike.
        part: share of such things that are of the kind that is sought.
    """
    kinds = [_kinds_of(room) for room in graph.rooms]
    times: Counter[str] = Counter()
    for kind in kinds:
        times.update(kind)  # expected number of rooms of a kind
    shares = {kind: thing.probability_in(kind) for kind in times}
    for absent, share in thing.rooms:
        near = next((one for one in _STANDS_IN.get(absent, ()) if one in times), None)
        if absent not in times and near is not None:
            shares[near] += share
    weights = np.array(
        [sum(shares[k] * p / max(1.0, times[k]) for k, p in one.items()) for one in kinds]
    )
    unknown = np.array([1 - sum(one.values()) for one in kinds])
    left = max(_LEAST_LEFT, 1 - sum(shares[k] * min(1.0, n) for k, n in times.items()))
    left *= min(1.0, unknown.sum() / _KINDS)  # each of them is of one kind
    alike = unknown * (1.0 if likeness is None else likeness[1:] + _LEAST)
    if alike.sum() > 0:
        weights = weights + left * alike / alike.sum()
    weights = weights + _ANYWHERE / max(1, len(weights))
    # Other buildings have what people search for in their kinds of rooms.
    ours = sum(
        thing.probability_in(kind) for kind in _ROOMS_OF.get(graph.building_kind or "home", ())
    )
    likely = thing.home if ours < _OURS else max(thing.home, _ELSEWHERE)
    rate = -part * math.log1p(-min(likely, _MOST_HOMES))
    seen = np.array([1 - room.hidden_share for room in graph.rooms])
    in_sight = _OF_SMALL if thing.wider != thing.name else _OF_LARGE
    hidden = np.where(seen < 1, 1 - in_sight * seen, 0.0)
    rates = np.concatenate([[0.0], rate * hidden * weights / max(weights.sum(), _WHOLE)])
    rates[0] = rates.sum() if len(graph.rooms) else rate * graph.hidden_share
    counts = poisson(rates[:, None])
    return counts, _none_of_rooms(counts)


def _kinds_of(room: KnownRoom) -> dict[str, float]:
    """Return the kinds that a room may be of, with probabilities that add up to 1 or less."""
    said = room.room_type
    return {} if said is None else {said: 1.0} if isinstance(said, str) else dict(said)


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
    return counts, max(_none_of_rooms(counts), 1 - float(counted.presence[0, 0]))


def _none_of_rooms(counts: CountDistribution) -> float:
    none = 1 - counts.presence[:, 0]
    return float(none[1:].prod() if len(none) > 1 else none[0])
