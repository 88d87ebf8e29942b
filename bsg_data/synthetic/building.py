"""Draw synthetic buildings with statistics like HM3D's.

A building has rooms, each of a latent type with a mean count per category. Counts vary with the
building's richness and its style (a factor per category), with the room's size, and with a burst
per room and category. Names then get HM3D's raw spellings, and the file its irregularities. Every
rate comes from `rates.json`, which `scripts/fit/synthetic_rates.py` at commit 4227eff fitted on
HM3D.
"""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, field
from importlib import resources
from typing import Any, NamedTuple

import numpy as np
from pydantic import ConfigDict

from bsg_data.arrays import Counts, Floats
from bsg_data.errors import RecipeError
from bsg_data.recipes import Record

MAX_SCENES = 10_000_000  # the digits of a scene id number no more
NULL_REGION = -1
_HM3D_SCENES = 900  # HM3D numbers 800 train scenes from 00000 and 100 val scenes from 00800
_VAL_EVERY = 9  # the last of every nine numbers is in val: 100 of 900, 2 of 20
_ALPHABET = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789"

_Named = tuple[str, int]  # raw name, region id


class SyntheticError(RecipeError, ValueError):
    """Report buildings that cannot be drawn as asked."""


class SyntheticRates(Record):
    """What synthetic buildings are drawn from: K room types, C named categories and the rare ones.

    Vectors `[C + 1]` end with all rare categories together. Spreads are variances of gamma factors
    of mean 1.
    """

    model_config = ConfigDict(extra="ignore")

    categories: tuple[str, ...]  # corrected names `[C]`
    # mean position of a category in the list of its room, 0 first and 1 last `[C + 1]`
    order: tuple[float, ...]
    regularity: tuple[
        float, ...
    ]  # fraction of the mean count that neither varies nor grows `[C + 1]`
    structure: tuple[int, ...]  # 1 for walls, floors, doors, ..., 0 for furnishing `[C + 1]`
    style: tuple[float, ...]  # spread of a category between buildings `[C + 1]`
    burst: tuple[float, ...]  # spread of a category between rooms `[C + 1]`
    # spread between buildings of all furnishing, and of all structure `[2]`
    richness: tuple[float, float]
    sizes: tuple[float, ...]  # spread of the size of a room, per type `[K]`
    # how much of its room's size structure follows, 0 to 1; furnishing follows it all
    growth: float
    rates: tuple[tuple[float, ...], ...]  # mean counts `[K, C + 1]`
    rooms: tuple[float, ...]  # weights of 0, 1, 2, ... rooms in a building.
    # (largest number of rooms, per type the weights of 0, 1, 2, ... rooms), ascending.
    bins: tuple[tuple[int, tuple[tuple[float, ...], ...]], ...]
    # per category (raw spelling, weight) `[C]`
    spellings: tuple[tuple[tuple[str, float], ...], ...]
    # concentrations of a building's urns of spellings and of rare names; small means that it keeps
    # to one
    novelty: tuple[float, float]
    starts_at_one: float  # probability that the first region id is 1, not 0
    gap: float  # probability that region ids skip some
    stray: float  # mean number of instances per room that are listed elsewhere
    shuffled: float  # probability that the rows are out of order
    null_region: float  # probability that some instances are in region -1


def load_rates() -> SyntheticRates:
    """Load the rates that the package ships."""
    path = resources.files("bsg_data.synthetic").joinpath("rates.json")
    return SyntheticRates.model_validate_json(path.read_text(encoding="utf-8"))


class SyntheticObject(NamedTuple):
    """One line of an annotation; a region below 0 is the null region."""

    instance_id: int
    region_id: int
    name: str
    colour: str  # hexadecimal


@dataclass(frozen=True, slots=True)
class SyntheticBuilding:
    """One synthetic building; its room types are (region id, index of the latent type)."""

    scene_id: str  # five digits or more, a dash and the hash: 00017-8bHk3aXq1Zc
    hash: str
    split: str
    rows: tuple[SyntheticObject, ...]
    room_types: tuple[tuple[int, int], ...] = field(repr=False)


def synthesise(rates: SyntheticRates, *, seed: int, number: int) -> SyntheticBuilding:
    """Sample one building; it depends only on rates, seed and number.

    The first 900 numbers have the ids of HM3D, whose val buildings follow its train buildings; the
    id of a later one is its number.
    """
    if seed < 0 or not 0 <= number < MAX_SCENES:
        raise SyntheticError(
            f"building {number} of seed {seed}: expected a number from 0 to {MAX_SCENES - 1}, and "
            "a seed from 0 on",
            code="number-range",
            where=number,
        )
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number))))
    types = _draw_room_types(rates, rng)
    regions = _draw_regions(rates, len(types), rng)
    counts = _draw_counts(rates, types, rng)
    rows = _number_rows(rates, _draw_names(rates, types, regions, counts, rng), rng)
    split, scene_id, name = name_building(seed, number)
    return SyntheticBuilding(scene_id, name, split, rows, tuple(zip(regions, types, strict=True)))


def name_building(seed: int, number: int) -> tuple[str, str, str]:
    """Return split, scene id and hash of a building."""
    value = int.from_bytes(hashlib.sha256(f"synthetic/{seed}/{number}".encode()).digest(), "big")
    name = "".join(_ALPHABET[value // 62**turn % 62] for turn in range(11))
    nines, turn = divmod(number, _VAL_EVERY)
    split, scene = ("val", 800 + nines) if turn == _VAL_EVERY - 1 else ("train", number - nines)
    return split, f"{number if number >= _HM3D_SCENES else scene:05d}-{name}", name


def _draw_room_types(rates: SyntheticRates, rng: np.random.Generator) -> tuple[int, ...]:
    """Sample a number of rooms, then how many of them are of each type; shuffled."""
    total = _pick(np.array(rates.rooms), rng)
    counts = next(counts for most, counts in rates.bins if total <= most)
    rest = [np.eye(1, total + 1)[0]]  # rest[k][n]: weight of n rooms in the types from k on
    for weights in reversed(counts):
        ways = np.convolve(rest[0], weights)[: total + 1]
        rest.insert(0, ways / ways.sum())
    types: list[int] = []
    for kind, weights in enumerate(counts):
        left = total - len(types)
        some = np.array(weights[: left + 1])
        types += [kind] * _pick(some * rest[kind + 1][left - np.arange(len(some))], rng)
    return tuple(int(kind) for kind in rng.permutation(types))


def _pick(weights: Floats, rng: np.random.Generator) -> int:
    """Sample an index in proportion to weights, which need not sum to 1."""
    ends = np.cumsum(weights)
    return int(np.searchsorted(ends, rng.random() * ends[-1], side="right"))


def _urn(drawn: list[Any], novelty: float, weights: Floats, rng: np.random.Generator) -> int:
    """Sample from a Polya urn, by weight or again what was drawn before, and remember the draw."""
    new = rng.random() * (novelty + len(drawn)) < novelty
    drawn.append(_pick(weights, rng) if new else drawn[int(rng.integers(len(drawn)))])
    return int(drawn[-1])


def _draw_regions(rates: SyntheticRates, rooms: int, rng: np.random.Generator) -> tuple[int, ...]:
    """Sample ascending region ids, which mostly count from 0."""
    regions = np.arange(rooms) + int(rng.random() < rates.starts_at_one)
    if rng.random() < rates.gap and rooms > 1:
        regions[rng.integers(1, rooms) :] += rng.integers(1, 4)
    return tuple(int(region) for region in regions)


def _draw_counts(rates: SyntheticRates, types: tuple[int, ...], rng: np.random.Generator) -> Counts:
    """Sample counts per room and category `[R, C + 1]`; no room is empty."""
    regular, structure = np.array(rates.regularity), np.array(rates.structure)
    style, burst, rich = np.array(rates.style), np.array(rates.burst), np.array(rates.richness)
    building = rng.gamma(1 / rich, rich)[structure] * rng.gamma(1 / style, style)
    counts = np.zeros((len(types), len(regular)), dtype=np.int64)
    for room, kind in enumerate(types):
        mean, size = np.array(rates.rates[kind]), rates.sizes[kind]
        while not counts[room].any():
            fixed = np.floor(regular * mean + rng.random(len(mean))).astype(np.int64)
            follows = np.where(structure == 1, rates.growth, 1.0)
            grown = 1 + follows * (rng.gamma(1 / size, size) - 1)
            varying = (1 - regular) * mean * building * grown * rng.gamma(1 / burst, burst)
            counts[room] = fixed + rng.poisson(varying)
    return counts


def _draw_names(
    rates: SyntheticRates,
    types: tuple[int, ...],
    regions: tuple[int, ...],
    every: Counts,
    rng: np.random.Generator,
) -> list[_Named]:
    """Sample the name and region of every instance from counts `[R, C + 1]`, room by room."""
    usual = np.array(rates.rates)[:, :-1] + 1e-9
    scarce = usual.mean(axis=0) <= np.median(usual.mean(axis=0))  # stand in for the rare ones
    weights = [np.array([weight for _, weight in known]) for known in rates.spellings]
    stand_ins: list[int] = []
    spelt: list[list[int]] = [[] for _ in rates.categories]
    named = []
    for region, kind, counts in zip(regions, types, every, strict=True):
        present = np.flatnonzero(counts)
        listed = np.argsort(np.array(rates.order)[present] + rng.normal(0, 0.25, len(present)))
        for chosen in np.repeat(present[listed], counts[present[listed]]):
            category = int(chosen)
            if category == len(rates.categories):
                category = _urn(stand_ins, rates.novelty[1], usual[kind] * scarce, rng)
            spelling = _urn(spelt[category], rates.novelty[0], weights[category], rng)
            named.append((rates.spellings[category][spelling][0], region))
    return named


def _number_rows(
    rates: SyntheticRates, named: list[_Named], rng: np.random.Generator
) -> tuple[SyntheticObject, ...]:
    """Fill the null region, move strays away from their rooms, and give ids and colours."""
    listed = list(named)
    if rng.random() < rates.null_region:
        listed += [(named[int(i)][0], NULL_REGION) for i in rng.integers(0, len(named), 3)]
    for _ in range(rng.poisson(rates.stray * len({region for _, region in named}))):
        moved = listed.pop(int(rng.integers(len(listed))))
        listed.insert(int(rng.integers(len(listed) + 1)), moved)
    colours = rng.choice(0xFFFFFF, size=len(listed), replace=False) + 1  # black is no instance
    rows = [
        SyntheticObject(index, region, name, colour=f"{colour:X}")
        for index, ((name, region), colour) in enumerate(zip(listed, colours, strict=True), 1)
    ]
    if rng.random() < rates.shuffled:
        rows = [rows[int(i)] for i in rng.permutation(len(rows))]
    return tuple(rows)
