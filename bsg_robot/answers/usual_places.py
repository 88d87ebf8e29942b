"""Say how likely a person would find everyday things in each room, by the table of things.

A home has Λ = −log(1 − home) of a thing in the mean (`bsg_robot.things.things`). They are spread
over its rooms by their kinds: the rooms of a kind share what people search for there. What kinds
have that are not there goes, as far as people search in both, to those that are. Rooms of which
nothing is known add what the known ones lack, and take nothing from them.

A robot that has seen a share v of a room's objects overlooks those that are not in sight, and has
seen v of the others. What is mostly in sight does not hide where all was seen, and things that are
always in sight are large, and seen sooner. A searched room has none.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.zoo.model import one_thread
from bsg_robot.answers.kind_table import KindTable, be_elsewhere, read_kinds
from bsg_robot.answers.kinds import RoomKinds
from bsg_robot.things.things import Thing, find_thing, list_narrower

IN_SIGHT = 0.7  # share of a thing that is in sight, from which on annotators note it
OF_HOMES = 0.4  # weight of what homes have, beside what annotators note
_ANYWHERE = 0.004  # share of a thing that is in a room of any kind
_WHOLE = 0.5  # rooms whose kinds have less of a thing are not all of a building
_MOST_HOMES = 0.995  # P(a home has one); in a table, 99 % is a round number
_SHARED = 0.8  # part of its things that a second bathroom shares with the first
_NEAR = 0.05  # share of a thing that a room has beside its own, when it takes those of another
_PASSING = 0.1  # of what passages keep in a home, in other buildings
_NAMED = 0.85  # share of rooms that have the thing in their name, such as a bicycle store
_THEIRS = 10.0  # how much more of a thing is in a room of its owner than in others of the kind
_LARGE = 0.9  # things that are in sight as often fill the floor, and are seen sooner


@dataclass(frozen=True, eq=False)
class Things:
    """T things, as rates need them.

    Attributes:
        names: of each, and of what it is one of.
        shares: `[T, K]` P(a search begins in rooms of a kind).
        homes: `[T]` P(a home has one).
        sights: `[T]` share that is in sight.
        stays: `[T]` hours after which half of them are elsewhere.
    """

    names: tuple[frozenset[str | None], ...]
    shares: Floats
    homes: Floats
    sights: Floats
    stays: Floats

    @classmethod
    def of(cls, things: Sequence[Thing], table: KindTable) -> Things:
        """Take some rows of the table, or things like them."""
        shares = [table.shares_of(thing) for thing in things]
        return cls(
            names=tuple(frozenset((thing.name, thing.wider)) for thing in things),
            shares=np.array(shares).reshape(len(things), len(table.kinds)),
            homes=np.array([thing.home for thing in things]),
            sights=np.array([thing.sight for thing in things]),
            stays=np.array([thing.stays for thing in things]),
        )


@dataclass(frozen=True, eq=False)
class ClassThings:
    """What the table of things has of the classes of a model.

    Attributes:
        things: those that are classes, then those that are such things. A class is at least as
            likely as a mug of its, which annotators overlook; of what is in sight, models know more
            than the table, but in rooms of a kind that they do not know.
        own: classes of the first ones.
        whole: classes of the others.
    """

    things: Things
    own: Ints
    whole: Ints

    @property
    def in_sight(self) -> Bools:
        """Which of the others annotators note."""
        return np.asarray(self.things.sights[len(self.own) :] >= IN_SIGHT)


@lru_cache(maxsize=1024)  # a search asks for one class, again and again
def find_things(classes: tuple[str, ...]) -> ClassThings:
    """Return what the table of things has of classes."""
    table = read_kinds()
    own = [(index, thing) for index, name in enumerate(classes) if (thing := find_thing(name))]
    parts = [(index, part) for index, thing in own for part in list_narrower(thing)]
    columns = np.array([index for index, _ in (*own, *parts)], dtype=np.int64)
    things = Things.of([thing for _, thing in (*own, *parts)], table)
    return ClassThings(things, columns[: len(own)], columns[len(own) :])


@one_thread()
def rate_things(
    things: Things, kinds: RoomKinds, graph: PartialGraph, *, owner: str | None = None
) -> Floats:
    """Return the mean numbers of T unseen things at every node, `[T, 1 + R]`, the building first.

    Args:
        things: that may be there.
        kinds: of the R rooms.
        graph: what a robot has seen.
        owner: whose they are, if somebody says.
    """
    rate = -np.log1p(-_expect(things, kinds).clip(max=_MOST_HOMES))
    rates = np.zeros((len(things.names), 1 + len(graph.rooms)))
    shares = things.shares * _pass(kinds)
    weights = _ANYWHERE + _spread_known(shares, kinds)
    weights[:, ~kinds.known] += _spread_unknown(shares, kinds)
    for row, names in zip(weights, things.names if any(kinds.named) else (), strict=False):
        if named := [room for room, things in enumerate(kinds.named) if things & names]:
            row *= 1 - _NAMED
            row[named] += _NAMED / len(named)
    if theirs := [room for room, name in enumerate(kinds.owners) if name and name == owner]:
        known = weights[:, kinds.known]  # rooms of which nothing is known take nothing from these
        weights[:, theirs] *= _THEIRS
        more = weights[:, kinds.known].sum(axis=1) / known.sum(axis=1)
        weights[:, kinds.known] /= more[:, None]
    rates[:, 1:] = rate[:, None] * weights * hide(things, graph)
    rates[:, 0] = rates[:, 1:].sum(axis=1)
    return rates


def _expect(things: Things, kinds: RoomKinds) -> Floats:
    """Return P(a building has one), `[T]`, of the kinds that it may be."""
    table = kinds.table
    ours = (table.is_foreign & table.usual).astype(float) @ things.shares.T  # [B, T]
    likely = table.usual.astype(float) @ things.shares.T / _WHOLE  # no bed in schools
    elsewhere = np.maximum(things.homes * likely.clip(max=1.0), be_elsewhere(ours))
    elsewhere[0] = things.homes
    return np.asarray(kinds.building @ elsewhere)


def _pass(kinds: RoomKinds) -> Floats:
    """Return which part of the things of each kind `[K]` its rooms keep in such a building."""
    return np.where(kinds.table.passages, kinds.at_home + (1 - kinds.at_home) * _PASSING, 1.0)


def _spread_known(shares: Floats, kinds: RoomKinds) -> Floats:
    """Return which part of a building's things each room has, `[T, R]`; 0 of unknown rooms."""
    table, rooms = kinds.table, kinds.rooms * kinds.known[:, None]
    times = rooms.sum(axis=0)
    present = times.clip(max=1.0)
    alike = table.alike * present * _pass(kinds)
    may_be = kinds.building @ table.usual
    moved = shares * (1 - present) * may_be * alike.sum(axis=1).clip(max=1.0)
    near = shares + _NEAR  # a missing closet's broom goes where brooms are, its shirts elsewhere
    every = shares * present + (moved / (near @ alike.T).clip(min=1e-9)) @ alike * near
    every /= (every @ may_be)[:, None].clip(min=_WHOLE)  # a child's bedroom has toys on top
    # Two bedrooms of a home share what bedrooms have; each classroom has its own.
    among = np.where(table.numbers[0] > 0, times, present).clip(min=1e-9)
    return np.asarray((every / among) @ rooms.T)


def _spread_unknown(shares: Floats, kinds: RoomKinds) -> Floats:
    """Return which part of a building's things its unknown rooms have, `[T, U]`."""
    table = kinds.table
    unknown, present = kinds.rooms[~kinds.known], kinds.rooms[kinds.known].sum(axis=0).clip(max=1.0)
    some = 1 - (1 - unknown).prod(axis=0)
    each = unknown * (some / unknown.sum(axis=0).clip(min=1e-9))
    may_be = kinds.building @ table.usual
    return np.asarray((shares * (1 - _SHARED * present) * may_be) @ each.T)


def hide(things: Things, graph: PartialGraph) -> Floats:
    """Return P(a thing was not seen, if it is in a room), `[T, R]`: also if it has come since."""
    sight = things.sights[:, None]
    hidden = np.array([room.hidden_share for room in graph.rooms])
    large = 1 + (sight > _LARGE)
    # What is mostly in sight stands on the floor, and does not hide where all of it was seen.
    away = (1 - sight) * np.where(sight >= IN_SIGHT, hidden, 1.0)
    then = np.where(hidden > 0, away + sight * hidden**large, 0.0)
    return np.asarray(1 - (1 - then) * graph.still_so(things.stays))
