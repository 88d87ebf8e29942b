"""Say where a thing is now, by what this home has taught: one law for sightings and for customs.

A thing has not moved since it was seen last with

    f = 2^(−age / stays) · max(w / (w + n), 2^(−age / 1 h)),    w = stays / 40 h

(`stays`: hours after which half of such things are elsewhere; n: how often it was seen elsewhere. A
cup that was seen at five other places is soon at one of them; a sofa stays). If it has moved, it is
where such things usually are in this home. A place has the weight

    α · prior + Σ over the sightings of the thing there: (base + same time of the day) · lasting
      + what other such things, things of the group, and people tell

The prior is that of all answers: tables of things, kinds and pieces, and models. Sightings count
less as they get older, so that two weeks of a new habit weigh as much as an old one. This is a
renewal process whose jumps forget where they begin; the weights are a Dirichlet posterior with a
kernel of the hour. Constants are chosen on HOMER (docs/results/habits.md).
"""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Iterable, Mapping, Sequence

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.belief.clock import DAY, HOUR
from bsg_models.belief.partial_graph import SeenObject, Sighting
from bsg_robot.things.pieces import Furniture

PRIOR = 0.5  # α, of the prior in all
_BASE = 0.6  # of each sighting
_SAME_HOUR = 2.0  # of a sighting at this time of another day, besides
_NEAR = 3.0  # hours, the standard deviation of that time
_OLD, _NEW = 20.0, 4.0  # days after which half of the weight of sightings is left, of
_LASTS = 0.5  # this part, and of the rest
_STEADY = 40.0  # hours for which a thing stays that make up for one sighting elsewhere
_JUST = 1.0  # hours after which half of what was just seen may have been put back
_ASTRAY = 0.3  # of the prior of what was moved, for all places alike: no table knows this home
ALIKE = 0.3  # of the sightings of another thing that is called alike
_KIN = 1.0  # most that sightings of other things of the group weigh, in all
_HALF_KIN = 4.0  # of them at a place, which weigh half of that
TOLD = 20.0  # of what people say: as two weeks of daily sightings at this hour
TOLD_KIN = 0.3  # of what people say of another thing of the group
NEVER = 0.001  # of the prior, where people say that a thing never is
SEEN_THERE = 0.05  # of the sightings of the thing itself there
AGAIN = 0.3  # further sightings of the same things after which half as many others are expected
OTHERS = 0.1  # of the number that the table expects, besides those that were seen here
KEPT = 2.3  # expected number of a thing of which people say where they keep it: P of .9
EXISTS = 0.97  # P(a thing that this home has had is still in it)

Places = Mapping[tuple[int, str | None], float]  # room and piece (None: unknown) → weight


def has_rested(stayed: float, hours: float, stays: float, *, elsewhere: int) -> float:
    """Return P(a thing is where it was seen), of a home that has seen it elsewhere.

    Args:
        stayed: 2^(−hours / stays).
        hours: since it was seen.
        stays: hours after which half of such things are elsewhere.
        elsewhere: number of its sightings at other places.
    """
    weight = stays / _STEADY
    just = 2.0 ** (-hours / min(_JUST, stays))
    return float(stayed * max(just, weight / (weight + elsewhere)))


def weigh_sightings(sightings: Iterable[Sighting], now: float) -> Places:
    """Return the weights of the places of one thing's sightings."""
    weights: dict[tuple[int, str | None], float] = defaultdict(float)
    for time, room, on in sightings:
        apart = abs((now - time + DAY / 2) % DAY - DAY / 2) / HOUR
        days = max(0.0, now - time) / DAY
        lasting = _LASTS * 2 ** (-days / _OLD) + (1 - _LASTS) * 2 ** (-days / _NEW)
        weights[room, on] += lasting * (_BASE + _SAME_HOUR * math.exp(-((apart / _NEAR) ** 2) / 2))
    return weights


def weigh_kin(kin: Iterable[Sequence[Sighting]]) -> Places:
    """Return the weights of places by how many other things of the group are there.

    One mug on the desk does not make it the place of forks; four toys on a shelf do.
    """
    things: dict[tuple[int, str | None], float] = defaultdict(float)
    for sightings in kin:
        for sight in sightings:
            things[sight.room_index, sight.on] += 1 / len(sightings)
    return {place: _KIN * n**2 / (n**2 + _HALF_KIN**2) for place, n in things.items()}


def join(*weights: tuple[Places, float]) -> Places:
    """Return the sum of weights of places, each with a factor."""
    every: dict[tuple[int, str | None], float] = defaultdict(float)
    for places, factor in weights:
        for place, weight in places.items():
            every[place] += factor * weight
    return every


def leave(weights: Places, left: Places, *, least: float = 0.0) -> Places:
    """Return what is left of the weights of places, or of their rooms; no less than a share."""
    share = {
        (node, piece): min(left.get((node, None), 1.0), left.get((node, piece), 1.0))
        for node, piece in weights
    }
    return {place: weight * max(least, share[place]) for place, weight in weights.items()}


def _share(weights: Floats) -> Floats:
    return np.asarray(weights / (weights.sum() or 1.0))


class Usual:
    """Where things of one kind are, for N nodes; one thing after the other is added.

    Attributes:
        none: `[N]` P(a node has none of them); of the building, P(it has none).
        new: `[N]` P(a node has none but those that are still where they were seen).
        names: ids of those that were seen.
    """

    def __init__(self, prior: Floats, left: Places, hide: Floats, places: Floats) -> None:
        """Begin without things.

        Args:
            prior: `[N]` expected number by all but this home's habits; the building's is not used.
            left: share of the prior of places that is left by what people say.
            hide: `[N]` P(a thing at a node was not seen there).
            places: `[N]` number of places of each node, 0 of the building.
        """
        self._left, self._hide = left, hide
        usual, astray = prior * (places > 0), places * hide
        for (node, piece), share in left.items():
            if piece is None:
                usual[node] *= share
                astray[node] *= share
        self._usual = _share(usual)
        self._moved = (1 - _ASTRAY) * self._usual + _ASTRAY * _share(astray)
        self.none, self.new = np.ones(len(prior)), np.ones(len(prior))
        self.names: set[str] = set()
        self._loose, self._unsaid = np.zeros(len(prior)), np.zeros(len(prior))
        self._pieces: dict[int, dict[str, float]] = defaultdict(dict)

    def add(
        self, moved: float, weights: Places, *, stayed: float, last: Sighting, name: str
    ) -> None:
        """Add a thing that was seen.

        Args:
            moved: P(it is not where it was seen last, and is where the weights and the prior say).
            weights: of places, beside those of the prior.
            stayed: P(it is where it was seen last).
            last: the last sighting.
            name: its id.
        """
        self.names.add(name)
        numbers = np.sum(self._spread(moved, weights, self._moved), axis=0)
        numbers[0] = numbers[1:].sum()
        self.new *= 1 - numbers
        numbers[[0, last.room_index]] += stayed
        self.none *= 1 - numbers
        if last.on is None:
            self._unsaid[last.room_index] += stayed
        else:
            self._put(last.room_index, last.on, stayed)

    def add_others(self, number: float, weights: Places) -> None:
        """Add an expected number of things that nobody saw.

        They are where the prior says, each on its own; or together, at one of the places that have
        weights, as this home keeps them.
        """
        if not number:
            return
        apart, together = (part / number for part in self._spread(number, weights, self._usual))
        share, joint = apart.sum(), together.sum()
        alone = np.exp(-number * apart / (share or 1.0))
        none = share * alone + joint - together * -math.expm1(-number) + (1 - share - joint)
        none[0] *= math.exp(-number)
        self._have(none)

    def add_counted(self, numbers: Floats) -> None:
        """Add expected numbers of unseen things, `[N]`, where a model counts them."""
        left = [self._left.get((node, None), 1.0) for node in range(len(numbers))]
        numbers = numbers * np.array([0.0, *left[1:]])
        self._loose += numbers
        self._have(np.exp(-np.array([numbers.sum(), *numbers[1:]])))

    def _have(self, none: Floats) -> None:
        self.none *= none
        self.new *= none

    def _spread(self, number: float, weights: Places, prior: Floats) -> tuple[Floats, Floats]:
        """Put a number of things where the prior and the weights say; return both, `[N]`."""
        weights = {place: weight * self._hide[place[0]] for place, weight in weights.items()}
        each = number / ((PRIOR * prior.sum() + sum(weights.values())) or 1.0)
        apart, together = each * PRIOR * prior, np.zeros(len(prior))
        self._loose += apart
        for (node, piece), weight in weights.items():
            together[node] += each * weight
            self._put(node, piece, each * weight)
        return apart, together

    def _put(self, node: int, piece: str | None, number: float) -> None:
        if piece is None:
            self._loose[node] += number
        else:
            here = self._pieces[node]
            here[piece] = here.get(piece, 0.0) + number

    def furnish(
        self, furniture: Furniture | None, node: int, objects: Sequence[SeenObject]
    ) -> Furniture | None:
        """Return the furniture of a node with the rates that habits give.

        What such things were seen on is a piece, too: a knife block, the floor.

        Args:
            furniture: without habits; None for what stands by itself.
            node: of the room.
            objects: in it.
        """
        known = {piece: n for piece, n in self._pieces.get(node, {}).items() if n}
        if furniture is None and not known:
            return None
        before = furniture or Furniture((), np.ones(1))
        more = tuple(o for o in objects if o.name in known and o not in before.pieces)
        left = [self._left.get((node, piece.name), 1.0) for piece in before.pieces]
        alike = before.rates.sum() / len(before.rates)
        astray = _ASTRAY if self.names else 0.0
        *each, unseen = (1 - astray) * before.rates + astray * alike
        rates = np.array([*(each * np.array(left)), *np.zeros(len(more)), unseen])
        pieces, loose = (*before.pieces, *more), float(self._loose[node])
        at = np.array([*(known.pop(piece.name, 0.0) for piece in pieces), 0.0])
        # What was seen, and nobody said on what, is on a piece that was seen.
        if before.rates[:-1].any():
            at[: len(before.pieces)] += self._unsaid[node] * _share(before.rates[:-1])
        else:
            at[-1] += self._unsaid[node]
        loose += sum(known.values())  # on what is no longer there
        if not (loose or at.any()) or not rates.sum():
            return Furniture(pieces, rates)
        return Furniture(pieces, at + loose * rates / rates.sum())
