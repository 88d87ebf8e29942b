"""The rates that synthetic buildings are drawn from, read from `rates.json`.

The file is fitted on HM3D by `scripts/fit/synthetic_rates.py` at commit 4227eff and holds
aggregates only.
"""

from __future__ import annotations

from importlib import resources
from typing import Annotated, Literal

from pydantic import AfterValidator, ConfigDict, Field, ValidationError, model_validator

from bsg_data.errors import RecipeError
from bsg_data.recipes import Record, name_fault

RATES_FILE = "rates.json"


class SyntheticError(RecipeError, ValueError):
    """Report buildings that cannot be drawn as asked, or rates that are malformed."""


def _require_some(weights: tuple[float, ...]) -> tuple[float, ...]:
    if not any(weights):
        raise ValueError("expected weights that are not all 0")
    return weights


def _require_one(spellings: tuple[tuple[str, float], ...]) -> tuple[tuple[str, float], ...]:
    _require_some(tuple(weight for _, weight in spellings))
    return spellings


Share = Annotated[float, Field(ge=0, le=1)]
Spread = Annotated[float, Field(ge=1e-6, allow_inf_nan=False)]
Weight = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Weights = Annotated[tuple[Weight, ...], AfterValidator(_require_some)]
Spelling = tuple[Annotated[str, Field(pattern=r'^[^"\n]*$')], Weight]  # quoted, on one line
Spellings = Annotated[tuple[Spelling, ...], AfterValidator(_require_one)]


class SyntheticRates(Record):
    """What synthetic buildings are drawn from: K room types, C named categories and the rare ones.

    Vectors `[C + 1]` end with all rare categories together. Spreads are variances of gamma factors
    of mean 1.

    Attributes:
        version: of the file's layout.
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

    model_config = ConfigDict(extra="ignore", strict=True)

    version: Literal[1]
    categories: Annotated[tuple[str, ...], Field(min_length=1)]
    order: tuple[Share, ...]
    regularity: tuple[Share, ...]
    structure: tuple[Literal[0, 1], ...]
    style: tuple[Spread, ...]
    burst: tuple[Spread, ...]
    richness: tuple[Spread, Spread]
    sizes: Annotated[tuple[Spread, ...], Field(min_length=1)]
    growth: Share
    rates: tuple[Weights, ...]
    rooms: Weights
    bins: Annotated[tuple[tuple[int, tuple[Weights, ...]], ...], Field(min_length=1)]
    spellings: tuple[Spellings, ...]
    novelty: tuple[Spread, Spread]
    starts_at_one: Share
    gap: Share
    stray: Weight
    shuffled: Share
    null_region: Share

    @model_validator(mode="after")
    def _check_sizes(self) -> SyntheticRates:
        types, names = len(self.sizes), len(set(self.categories))
        sizes = {"categories": names, "spellings": names, "rates": types}
        wide = dict.fromkeys(("order", "regularity", "structure", "style", "burst"), names + 1)
        for field, size in (sizes | wide).items():
            if len(getattr(self, field)) != size:
                raise ValueError(f"{field}: expected {size} entries, each once")
        if any(len(means) != names + 1 for means in self.rates):
            raise ValueError(f"rates: expected {names + 1} means a type")
        if any(len(weights) != types for _, weights in self.bins):
            raise ValueError(f"bins: expected weights for {types} types in each")
        if self.rooms[0] or self.bins[-1][0] < len(self.rooms) - 1:
            raise ValueError("rooms: expected none of 0 rooms, and every number in a bin")
        return self


def load_rates() -> SyntheticRates:
    """Load the rates that the package ships; raise SyntheticError if they are malformed."""
    path = resources.files("bsg_data.synthetic").joinpath(RATES_FILE)
    return parse_rates(path.read_text(encoding="utf-8"))


def parse_rates(text: str) -> SyntheticRates:
    """Parse the text of a rates file; raise SyntheticError naming the field that is malformed."""
    try:
        return SyntheticRates.model_validate_json(text)
    except ValidationError as error:
        raise SyntheticError(f"{RATES_FILE}: {name_fault(error)}") from error
