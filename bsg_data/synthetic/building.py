"""Draw synthetic buildings: rooms of ten kinds, with what HM3D's rooms of a kind hold on average.

`rooms.csv` has mean numbers, of the 145 train scenes of HM3D's public statistics: in its first row
of rooms of a kind in a building, below of each name in such a room. The `steady` share of a number
does not vary; the rest does with the building's taste, the room's size, and by chance.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass
from functools import cache
from importlib import resources
from typing import NamedTuple

import numpy as np

from bsg_data.arrays import Counts, Floats

_ROOMS = (4, 34)  # least and most, as in HM3D
_IN_EVERY_HOME = ("bathroom", "bedroom", "kitchen", "living room")
_NULL_REGION = 0.1  # share of buildings that list some instances in region -1
_HM3D_SCENES = 900  # HM3D numbers 800 train scenes from 00000 and 100 val scenes from 00800
_VAL_EVERY = 9  # the last of every nine numbers is in val: 100 of 900, 2 of 20
_ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"


class _RoomTable(NamedTuple):
    """What `rooms.csv` says of K kinds of rooms and C names."""

    kinds: tuple[str, ...]  # words of room layouts `[K]`
    names: tuple[str, ...]  # as annotations have them `[C]`
    rooms: Floats  # mean number in a building `[K]`
    counts: Floats  # mean number in a room `[K, C]`
    steady: Floats  # share of the mean number that does not vary `[C]`


@cache
def read_rooms() -> _RoomTable:
    """Read the table that the package ships."""
    text = resources.files("bsg_data.synthetic").joinpath("rooms.csv").read_text("utf-8")
    header, rooms, *rows = (line.split(",") for line in text.splitlines())
    values = np.array([[float(cell or 0) for cell in row[1:]] for row in rows])
    return _RoomTable(
        tuple(header[2:]),
        tuple(row[0] for row in rows),
        np.array(rooms[2:], dtype=float),
        values[:, 1:].T,
        values[:, 0],
    )


class SyntheticObject(NamedTuple):
    """One line of an annotation; a region below 0 is the null region."""

    instance_id: int
    region_id: int
    name: str
    colour: str  # hexadecimal


@dataclass(frozen=True, slots=True)
class SyntheticBuilding:
    """One synthetic building."""

    scene_id: str  # five digits or more, a dash and the hash: 00017-8bHk3aXq1Zc
    hash: str
    split: str
    rooms: tuple[str, ...]  # kinds of its rooms, by ascending region id
    rows: tuple[SyntheticObject, ...]


def synthesise(*, seed: int, number: int) -> SyntheticBuilding:
    """Sample one building; it depends only on seed and number.

    The first 900 numbers have the ids of HM3D, whose val buildings follow its train buildings; the
    id of a later one is its number.
    """
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number))))
    table = read_rooms()
    kinds = _draw_kinds(table, rng)
    rows = _list_rows(table, _draw_counts(table, kinds, rng), rng)
    split, scene_id, name = name_building(seed, number)
    return SyntheticBuilding(scene_id, name, split, tuple(table.kinds[k] for k in kinds), rows)


def name_building(seed: int, number: int) -> tuple[str, str, str]:
    """Return split, scene id and hash of a building."""
    value = int.from_bytes(hashlib.sha256(f"synthetic/{seed}/{number}".encode()).digest(), "big")
    name = "".join(_ALPHABET[value // 62**turn % 62] for turn in range(11))
    nines, turn = divmod(number, _VAL_EVERY)
    split, scene = ("val", 800 + nines) if turn == _VAL_EVERY - 1 else ("train", number - nines)
    return split, f"{number if number >= _HM3D_SCENES else scene:05d}-{name}", name


def _draw_kinds(table: _RoomTable, rng: np.random.Generator) -> list[int]:
    """Sample the kinds of the rooms of a building, 14 on average."""
    fewest, upper_bound = _ROOMS
    total = min(fewest + int(rng.negative_binomial(5, 1 / 3)), upper_bound)
    kinds = [table.kinds.index(kind) for kind in _IN_EVERY_HOME]
    more = rng.choice(len(table.kinds), total - fewest, p=table.rooms / table.rooms.sum())
    return [int(kind) for kind in rng.permutation([*kinds, *more])]


def _draw_counts(table: _RoomTable, kinds: list[int], rng: np.random.Generator) -> Counts:
    """Sample counts per room and name `[R, C]`; every room has a wall at least."""
    mean, shape = table.counts[kinds], (len(kinds), len(table.names))
    taste, size = rng.gamma(2, 1 / 2, shape[1]), rng.gamma(4, 1 / 4, (shape[0], 1))
    fixed = np.floor(table.steady * mean + rng.random(shape)).astype(np.int64)
    varying = (1 - table.steady) * mean * taste * size * rng.exponential(1, shape)
    counts = fixed + rng.poisson(varying)
    counts[:, 0] = np.maximum(counts[:, 0], 1)
    return np.asarray(counts)


def _list_rows(
    table: _RoomTable, counts: Counts, rng: np.random.Generator
) -> tuple[SyntheticObject, ...]:
    """List the instances room by room, with ids and colours; regions count from 0 or from 1."""
    first = int(rng.random() < 0.3)
    rooms, names = (np.repeat(places, counts[counts > 0]) for places in np.nonzero(counts))
    listed = [*zip(names.tolist(), (rooms + first).tolist(), strict=True)]
    if rng.random() < _NULL_REGION:
        listed += [(name, -1) for name, _ in listed[:3]]
    colours = rng.choice(0xFFFFFF, size=len(listed), replace=False) + 1  # black is no instance
    return tuple(
        SyntheticObject(index, region, table.names[name], colour=f"{colour:X}")
        for index, ((name, region), colour) in enumerate(zip(listed, colours, strict=True), 1)
    )
