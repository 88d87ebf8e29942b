"""What is known of kinds of rooms, by hand: how many a building has, and which things are there.

kinds-v1.csv        a kind, how many rooms of it each kind of building has, its floor area, how
many rooms are beside it, and whether people only pass through
hand-prior-v1.json  P(a room of a kind has a class)
things-v1.csv       where people search for other things, and P(a home has one)
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache, cached_property, lru_cache

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.scene.room_label import known_label
from bsg_models.zoo.hand_prior import read_hand_table
from bsg_robot.tables.table import read_table
from bsg_robot.things.things import Thing, find_thing, list_things, read_narrow

_FACTS = ("kind", "floor_area", "spread", "neighbours", "passage", "furnished_like", "holds")
_LEAST, _MOST = 0.01, 0.98  # P(a room has a thing); nothing is impossible
# Other buildings surely have what people search for, with this share, in rooms that homes lack.
_OURS, _ELSEWHERE = 0.15, 0.95
_FOREIGN = 0.4  # of the things of the nearest kind, in a kind of which the table says nothing
_OFTEN = 0.1  # rooms of a kind that a building has, if people search there
_RARE = 0.01  # rooms of any kind that a building may have
_HARDLY = 0.2  # kinds of rooms that are less alike have nothing in common


@dataclass(frozen=True, eq=False)
class KindTable:
    """What is known of K kinds of rooms, B kinds of buildings and T everyday things.

    Attributes:
        kinds: labels of rooms.
        buildings: the home is the first.
        numbers: `[B, K]` expected number of rooms.
        floor_area: `[K]` median, square metres.
        spread: `[K]` standard deviation of its logarithm.
        neighbours: `[K]` expected number of rooms beside it.
        passages: `[K]` whether people only pass through, such as a lift.
        things: the rows of the table of things.
        shares: `[T, K]` P(a search for it begins in rooms of this kind).
        presence: `[K, T]` p, P(a room of this kind has one).
        is_class: `[T]` things of which everybody who looks takes notice.
    """

    kinds: tuple[str, ...]
    buildings: tuple[str, ...]
    numbers: Floats
    floor_area: Floats
    spread: Floats
    neighbours: Floats
    passages: Bools
    things: tuple[Thing, ...]
    shares: Floats
    presence: Floats
    is_class: Bools

    @cached_property
    def is_foreign(self) -> Bools:
        """Kinds that homes lack, `[K]`."""
        return np.asarray(self.numbers[0] < _OFTEN)

    @cached_property
    def usual(self) -> Bools:
        """Kinds in which people search, if a building has them, `[B, K]`; others come on top."""
        return np.vstack([(self.numbers[0] > 0) & self.is_known, self.numbers[1:] >= _OFTEN])

    @cached_property
    def is_known(self) -> Bools:
        """Kinds that models read as themselves, `[K]`."""
        return np.array([known_label(kind) == kind for kind in self.kinds])

    @cached_property
    def smoothed(self) -> Floats:
        """Numbers of rooms of each kind in a building, `[B, K]`, of which none is impossible."""
        return self.numbers.clip(min=_RARE)

    @cached_property
    def chances(self) -> Floats:
        """P(a room of a building is of a kind), `[B, K]`."""
        return np.asarray(self.smoothed / self.smoothed.sum(axis=1, keepdims=True))

    @cached_property
    def row(self) -> dict[str, int]:
        """Name of a thing → its row."""
        return {thing.name: number for number, thing in enumerate(self.things)}

    @cached_property
    def column(self) -> dict[str, int]:
        """Kind → its column."""
        return {kind: number for number, kind in enumerate(self.kinds)}

    def shares_of(self, thing: Thing) -> Floats:
        """Return P(a search for a thing begins in rooms of each kind), `[K]`."""
        row = self.row.get(thing.name)
        if row is not None and self.things[row] is thing:
            return np.asarray(self.shares[row])
        return np.asarray(_share([thing], self.kinds)[0][0])

    @cached_property
    def log_presence(self) -> Floats:
        """Logarithms of the presence, `[K, T]`."""
        return np.log(self.presence)

    @cached_property
    def alike(self) -> Floats:
        """How far people search in one kind of room for what is in another, `[K, K]`, 0 to 1."""
        length = np.linalg.norm(self.shares, axis=0).clip(min=1e-9)
        alike: Floats = self.shares.T @ self.shares / np.outer(length, length)
        np.fill_diagonal(alike, 0.0)
        alike[:, [kind in read_narrow() for kind in self.kinds]] = 0.0
        return np.asarray(np.where(alike < _HARDLY, 0.0, alike))


@lru_cache(maxsize=4096)  # the rooms of a map have the same ones
def log_presence_of(thing: Thing, table: KindTable) -> Floats:
    """Return log P(a room of each kind has a thing that a word has moved), `[K]`."""
    shares, named = _share([thing], table.kinds)
    return np.log(_be_present([thing], shares, named, table.numbers)[:, 0])


@cache
def read_kinds() -> KindTable:
    """Read the tables."""
    table = read_table("kinds-v1.csv")
    kinds, buildings = table["kind"], tuple(name for name in table if name not in _FACTS)
    numbers = np.array([table[name] for name in buildings], dtype=float)
    things = list_things()
    shares, named = _share(things, kinds)
    presence = _be_present(things, shares, named, numbers)
    by_hand, is_class = _read_presence(kinds, things)
    presence = np.where(np.isnan(by_hand), presence, by_hand)
    return KindTable(
        kinds=kinds,
        buildings=buildings,
        numbers=numbers,
        floor_area=np.array(table["floor_area"], dtype=float),
        spread=np.array(table["spread"], dtype=float),
        neighbours=np.array(table["neighbours"], dtype=float),
        passages=np.array(table["passage"]) == "yes",
        things=things,
        shares=shares,
        presence=presence,
        is_class=is_class,
    )


def _be_present(things: Sequence[Thing], shares: Floats, named: Bools, numbers: Floats) -> Floats:
    """Return P(a room of a kind has a thing) from shares `[T, K]`, `[K, T]`."""
    homes = np.array([[thing.home] for thing in things]).clip(max=_MOST)
    foreign = named & (numbers[0] < _OFTEN)
    others = be_elsewhere((shares * foreign).sum(axis=1, keepdims=True))
    has_one = np.where(foreign, np.maximum(homes, others), homes)
    each = shares / numbers[0].clip(min=1.0)  # the rooms of a kind share what is there
    return np.asarray((1 - (1 - has_one) ** each).T.clip(_LEAST, _MOST))


def be_elsewhere(shares: Floats) -> Floats:
    """Return P(another building has a thing), of shares in kinds of rooms that homes lack."""
    return np.asarray(_ELSEWHERE * (shares / _OURS).clip(max=1.0))


def _read_presence(kinds: Sequence[str], things: Sequence[Thing]) -> tuple[Floats, Bools]:
    """Return P(a room has a class) by hand, `[K, T]`, NaN for other things; which are classes."""
    tables = read_hand_table()["room_types"]
    row = {thing.name: number for number, thing in enumerate(things)}
    names = {name for table in tables.values() for name in table["presence"]}
    columns = {name: row[thing.name] for name in sorted(names) if (thing := find_thing(name))}
    by_hand, is_class = (
        np.full((len(kinds), len(things)), np.nan),
        np.zeros(len(things), dtype=bool),
    )
    is_class[[*columns.values()]] = True
    for number, kind in enumerate(kinds):
        table = tables.get(kind, tables.get(known_label(kind)))
        if table is not None:
            likely = np.array([table["presence"].get(name, 0.0) for name in columns])
            np.fmax.at(by_hand[number], [*columns.values()], likely.clip(_LEAST, _MOST))
    return by_hand, is_class


def _share(things: Sequence[Thing], kinds: Sequence[str]) -> tuple[Floats, Bools]:
    """Return the shares of kinds `[T, K]`, and which the table names.

    Those of kinds that homes have sum to 1.
    """
    column = {kind: number for number, kind in enumerate(kinds)}
    cells = [
        (row, column[kind], share)
        for row, thing in enumerate(things)
        for kind, share in thing.rooms
        if kind in column
    ]
    rows, columns, weights = zip(*cells, strict=True)
    shares, named = np.zeros((len(things), len(kinds))), np.zeros((len(things), len(kinds)), bool)
    shares[rows, columns], named[rows, columns] = weights, True
    near = [known_label(kind) for kind in kinds]
    follows = [
        kind != known and kind not in read_narrow() for kind, known in zip(kinds, near, strict=True)
    ]
    like = _FOREIGN * shares[:, [column[kind] for kind in near]]
    return np.where(follows & ~named, like, shares), named
