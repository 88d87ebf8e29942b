"""Recipes: all that a split or a mask depends on, stored in the manifest of the dataset."""

from __future__ import annotations

from typing import Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError


class Record(BaseModel):
    """A frozen record that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def name_fault(error: ValidationError) -> str:
    """Return where the first fault of a record is and what it is: `rooms.0.id: Field required`."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"]) or "the whole file"
    return f"{where}: {first['msg']}"


class SplitRecipe(Record):
    """How buildings are assigned to splits.

    Attributes:
        method: `ratios`; `official`, the source's val as test and a val carved out of its train;
            or `folds` for cross-validation.
        seed: of the shuffle of the buildings.
        ratios: shares of train, val and test; of train and val alone under `official` (the third
            is 0); None under `folds`.
        folds: number of folds; None otherwise.
    """

    method: Literal["ratios", "official", "folds"] = "ratios"
    seed: int = Field(default=0, ge=0)
    ratios: tuple[float, float, float] | None = (0.8, 0.1, 0.1)
    folds: int | None = Field(default=None, ge=2, le=10_000)


class MaskRecipe(Record):
    """How objects are hidden: with a scene and a draw, this is all that a mask depends on.

    Attributes:
        strategy: a name of `bsg_data.observation.masks.MASKS`; `uniform` is the paper's.
        fraction: share of a building's classified objects to hide, 0..1.
        seed: of the generator.
    """

    strategy: str = Field(default="uniform", pattern=r"^[a-z][a-z0-9-]*$")
    fraction: float = Field(default=0.5, ge=0.0, le=1.0)
    seed: int = Field(default=0, ge=0)


class PairsRecipe(Record):
    """How masked pairs are drawn: a mask, and how many draws of every building."""

    mask: MaskRecipe = MaskRecipe()
    draws: int = Field(default=10, ge=1, le=1_000_000)
