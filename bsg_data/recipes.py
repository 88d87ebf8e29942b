"""Recipes: all that a split or a mask depends on, stored in the manifest of the dataset."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

Share = Annotated[float, Field(ge=0.0, le=1.0)]


class Record(BaseModel):
    """A frozen record that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


def name_fault(error: ValidationError) -> str:
    """Return where the first fault of a record is and what it is: `rooms.0.id: Field required`."""
    first = error.errors()[0]
    where = ".".join(str(part) for part in first["loc"]) or "the whole file"
    return f"{where}: {first['msg'].removeprefix('Value error, ')}"


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


class Exploration(Record):
    """How a robot goes through a building under the mask `explore`.

    The fraction f of what is there is hidden, 1 − f is shown. `not_entered` and `searched` say how
    much of either is whole rooms; the rest falls to the rooms that are half seen. The other masks
    are corners of it: see `bsg_data.observation.masks`.

    Attributes:
        not_entered: part of what is hidden that is rooms which were not entered: from where to
            where, each draw taking one value uniformly.
        searched: part of what is shown that is rooms which were searched, likewise.
        glimpsed: probability that a room beside one that was entered, and that was not entered
            itself, was seen through the door.
        glimpsed_share: share that such a room hides: from where to where, uniformly.
        spread: how much the shares of rooms that are half seen differ: uniformly, by at most
            spread · min(b, 1 − b) from their mean b; 0 for none.
        connected: whether the robot enters room after room over the connections; otherwise it was
            in rooms that are scattered.
        exact: whether rooms of one share s lose together ⌊s · their objects⌋, as the paper's mask
            does, instead of each object by itself with the probability s.
    """

    not_entered: tuple[Share, Share] = (0.0, 1.0)
    searched: tuple[Share, Share] = (0.0, 1.0)
    glimpsed: Share = 0.5
    glimpsed_share: tuple[Share, Share] = (0.7, 0.98)
    spread: float = Field(default=0.8, ge=0.0, lt=1.0)
    connected: bool = True
    exact: bool = False

    @model_validator(mode="after")
    def _ranges_rise(self) -> Exploration:
        for name in ("not_entered", "searched", "glimpsed_share"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name} must rise, found {[low, high]}")
        return self


class MaskRecipe(Record):
    """How objects are hidden: with a scene and a draw, this is all that a mask depends on.

    Attributes:
        strategy: a name of `bsg_data.observation.masks.MASKS`; `uniform` is the paper's.
        fraction: share of a building's objects that the mask hides in the mean, 0..1.
        seed: of the generator.
        withhold: share of the classes that are withheld, each by itself: nothing of a withheld
            class is shown outside rooms that were searched.
        parts: whether parts of a thing that are outside the classes are hidden with it
            (`bsg_data.scene.parts`).
        exploration: what `explore` reads besides.
    """

    strategy: str = Field(default="uniform", pattern=r"^[a-z][a-z0-9-]*$")
    fraction: float = Field(default=0.5, ge=0.0, le=1.0)
    seed: int = Field(default=0, ge=0)
    withhold: Share = 0.0
    parts: bool = False
    exploration: Exploration = Exploration()

    def __str__(self) -> str:
        """Say it in words, without its seed and without what is not asked for.

        >>> str(MaskRecipe(strategy="explore", withhold=0.2, parts=True))
        'explore, fraction 0.5, withhold 0.2, parts'
        """
        words = [self.strategy, f"fraction {self.fraction}"]
        words += [f"withhold {self.withhold}"] if self.withhold else []
        words += ["parts"] if self.parts else []
        words += ["exploration of its own"] if self.exploration != Exploration() else []
        return ", ".join(words)


class PairsRecipe(Record):
    """How masked pairs are drawn: a mask, and how many draws of every building.

    Attributes:
        mask: how objects are hidden.
        draws: masks of every building.
        masks: version of the masks: 1 those of format 1 (`bsg_data.observation.masks_v1`), by which
            nothing is drawn any more, but pairs stay what they were when a dataset is upgraded.
    """

    mask: MaskRecipe = MaskRecipe()
    draws: int = Field(default=10, ge=1, le=1_000_000)
    masks: Literal[1, 2] = 2
