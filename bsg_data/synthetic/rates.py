"""The rates that synthetic buildings are drawn from, read from `rates.json`.

The file is fitted on HM3D by `scripts/fit/synthetic_rates.py` at commit 4227eff and holds
aggregates only.
"""

from __future__ import annotations

from importlib import resources

from pydantic import ConfigDict

from bsg_data.errors import RecipeError
from bsg_data.recipes import Record


class SyntheticError(RecipeError, ValueError):
    """Report buildings that cannot be drawn as asked."""


class SyntheticRates(Record):
    """What synthetic buildings are drawn from: K room types, C named categories and the rare ones.

    Vectors `[C + 1]` end with all rare categories together. Spreads are variances of gamma factors
    of mean 1.
    """

    model_config = ConfigDict(extra="ignore")

    categories: tuple[str, ...]  # corrected names `[C]`
    # mean place of a category in the list of its room, 0 first and 1 last `[C + 1]`
    order: tuple[float, ...]
    regularity: tuple[float, ...]  # share of the mean count that neither varies nor grows `[C + 1]`
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
