"""The rates that synthetic buildings are drawn from, read from `rates.json`.

The file is fitted on HM3D by `scripts/fit_synthetic_rates.py` and holds aggregates only.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, fields
from importlib import resources
from typing import Any

import numpy as np

from bsg_data.errors import RecipeError

RATES_FILE = "rates.json"
RATES_VERSION = 1

Vector = tuple[float, ...]


class SyntheticError(RecipeError, ValueError):
    """Report buildings that cannot be drawn as asked, or rates that are malformed."""


@dataclass(frozen=True, slots=True)
class SyntheticRates:
    """What synthetic buildings are drawn from: K room types, C named categories and the rare ones.

    Vectors `[C + 1]` end with all rare categories together. Spreads are variances of gamma factors
    of mean 1. Raises SyntheticError for a field of the wrong shape or out of range, naming it.

    Attributes:
        categories: corrected names `[C]`.
        order: mean place of a category in the list of its room, 0 first and 1 last `[C + 1]`.
        regularity: share of the mean count that neither varies nor grows `[C + 1]`.
        structure: 1 for walls, floors, doors, ..., 0 for furnishing `[C + 1]`.
        style: spread of a category between buildings `[C + 1]`.
        burst: spread of a category between rooms `[C + 1]`.
        richness: spread between buildings of all furnishing, and of all structure `[2]`.
        sizes: spread of the size of a room, per type `[K]`.
        growth: how much of its room's size structure follows, 0 to 1; furnishing follows it all.
        rates: mean counts `[K, C + 1]`.
        rooms: weights of 0, 1, 2, ... rooms in a building.
        bins: (largest number of rooms, per type the weights of 0, 1, 2, ... rooms), ascending.
        spellings: per category (raw spelling, weight) `[C]`.
        novelty: concentrations of a building's urns of spellings and of rare names; small means
            that it keeps to one.
        starts_at_one: probability that the first region id is 1, not 0.
        gap: probability that region ids skip some.
        stray: mean number of instances per room that are listed elsewhere.
        shuffled: probability that the rows are out of order.
        null_region: probability that some instances are in region -1.
    """

    categories: tuple[str, ...]
    order: Vector
    regularity: Vector
    structure: tuple[int, ...]
    style: Vector
    burst: Vector
    richness: Vector
    sizes: Vector
    growth: float
    rates: tuple[Vector, ...]
    rooms: Vector
    bins: tuple[tuple[int, tuple[Vector, ...]], ...]
    spellings: tuple[tuple[tuple[str, float], ...], ...]
    novelty: Vector
    starts_at_one: float
    gap: float
    stray: float
    shuffled: float
    null_region: float

    def __post_init__(self) -> None:
        names, types = (len(self.categories),), (len(self.sizes),)
        wide = (len(self.categories) + 1,)
        for name in ("style", "burst"):
            _check(name, getattr(self, name), wide, least=1e-6)
        for name in ("order", "regularity", "structure"):
            _check(name, getattr(self, name), wide, most=1)
        for name in ("richness", "novelty"):
            _check(name, getattr(self, name), (2,), least=1e-6)
        for name in ("growth", "starts_at_one", "gap", "shuffled", "null_region"):
            _check(name, getattr(self, name), (), most=1)
        _check("stray", self.stray, ())
        _check("sizes", self.sizes, types, least=1e-6)
        _check("rates", self.rates, types + wide, some=True)
        _check("rooms", self.rooms, (len(self.rooms),), some=True)
        for _, counts in self.bins:
            for weights in counts:
                _check("bins", weights, (len(weights),), some=True)
        for known in self.spellings:
            _check("spellings", [weight for _, weight in known], (len(known),), some=True)
            if any('"' in raw or "\n" in raw for raw, _ in known):
                raise _malformed("spellings", "no quotes and no line ends")
        if not len(set(self.categories)) == len(self.spellings) == names[0] > 0:
            raise _malformed("categories", "distinct names, with spellings for each")
        if not self.bins or any(len(counts) != types[0] for _, counts in self.bins):
            raise _malformed("bins", f"weights for {types[0]} types in each")
        if self.rooms[0] or self.bins[-1][0] < len(self.rooms) - 1:
            raise _malformed("rooms", "no building without rooms, and every number in a bin")


def _malformed(name: str, expected: str) -> SyntheticError:
    return SyntheticError(f"{RATES_FILE}: {name}: expected {expected}")


def _check(
    name: str,
    values: object,
    shape: tuple[int, ...],
    *,
    least: float = 0,
    most: float = float("inf"),
    some: bool = False,
) -> None:
    """Raise unless the values are finite numbers of this shape and range, `some` of a row not 0."""
    try:
        array = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        array = np.full(shape, np.nan)
    right = array.shape == shape and array.size > 0 and np.isfinite(array).all()
    if not right or array.min() < least or array.max() > most:
        raise _malformed(name, f"numbers of shape {list(shape)} from {least:g} to {most:g}")
    if some and not array.any(axis=-1).all():
        raise _malformed(name, "not all 0")


def load_rates() -> SyntheticRates:
    """Load the rates that the package ships; raise SyntheticError if they are malformed."""
    path = resources.files("bsg_data.synthetic").joinpath(RATES_FILE)
    return parse_rates(path.read_text(encoding="utf-8"))


def parse_rates(text: str) -> SyntheticRates:
    """Parse the text of a rates file; raise SyntheticError naming the field that is malformed."""
    try:
        data = json.loads(text)
    except json.JSONDecodeError as error:
        raise SyntheticError(f"{RATES_FILE}: not JSON ({error})") from error
    if not isinstance(data, dict) or data.get("version") != RATES_VERSION:
        raise _malformed("version", str(RATES_VERSION))
    names = [one.name for one in fields(SyntheticRates)]
    missing = [name for name in names if name not in data]
    if missing:
        raise _malformed(missing[0], "a value, found none")
    try:
        return SyntheticRates(**{name: _frozen(data[name]) for name in names})
    except SyntheticError:
        raise
    except (TypeError, ValueError) as error:
        raise SyntheticError(f"{RATES_FILE}: a field is of the wrong shape ({error})") from error


def _frozen(value: Any) -> Any:
    return tuple(_frozen(one) for one in value) if isinstance(value, list) else value
