"""Recipes: records of all settings of a split or a mask, stored in the manifest of a dataset."""

from __future__ import annotations

import math
from numbers import Real
from typing import Annotated, Any, Literal

from pydantic import (
    BaseModel,
    ConfigDict,
    Field,
    ValidationError,
    ValidationInfo,
    field_validator,
    model_validator,
)

from bsg_data.errors import RecipeError, ask_to_upgrade
from bsg_data.first_fault import keep_one_unknown
from bsg_data.tables import make_line
from bsg_data.words.shown import SHOWN, show_value

MAX_SEED = 2**63 - 1  # what TOML, torch and a table of numbers can hold
Fraction = Annotated[float, Field(ge=0.0, le=1.0)]  # of things, or a probability
Seed = Annotated[int, Field(ge=0, le=MAX_SEED)]  # of random draws


class Record(BaseModel):
    """A frozen record that refuses unknown keys."""

    model_config = ConfigDict(extra="forbid", frozen=True)


class SaidRecord(Record):
    """A record that a stranger fills: of many unknown keys, one is told."""

    @model_validator(mode="before")
    @classmethod
    def _keep_one_unknown(cls, said: Any) -> Any:
        known = {one.alias or name for name, one in cls.model_fields.items()}
        return keep_one_unknown(said, known)


# kinds of faults: our own message, a text that is no JSON, an unknown key
_SELF_EXPLAINING = ("value_error", "json_invalid", "extra_forbidden")


def name_fault(error: ValidationError) -> str:
    """Return key and kind of the first fault of a record: `rooms.0.id: Field required`.

    A word or a number that is wrong is shown, unless the fault is not in it or says it already.
    """
    first = error.errors(include_url=False)[0]
    where = ".".join(make_line(str(key)[:SHOWN]) for key in first["loc"]) or "the whole file"
    value = first["input"]
    is_shown = isinstance(value, str | int | float) and first["type"] not in _SELF_EXPLAINING
    shown = f", found {show_value(value)}" if is_shown else ""
    said = first["msg"].removeprefix("Value error, ").replace("valid tuple", "valid list")
    if first["type"] == "too_long":  # pydantic's words say that it was validated
        said = f"expected at most {first['ctx']['max_length']:,} entries, found more"
    if first["type"] == "literal_error" and first["loc"][-1:] == ("version",):
        shown += f"; {ask_to_upgrade(value, 1, otherwise='another program wrote it')}"
    return f"{where}: {said}{shown}"


def read_number(name: str, value: object, *, most: float, wanted: str = "") -> float:
    """Return a number from 0 to `most`, of Python or of NumPy, as Python's."""
    try:
        is_number = isinstance(value, Real) and not isinstance(value, bool)
        number = float(value) if is_number else math.nan  # type: ignore[arg-type]
    except OverflowError:  # an integer beyond all floats
        number = math.nan
    if 0 <= number <= most:
        return number
    span = "0 or more" if most == math.inf else f"0 to {most:g}"
    raise RecipeError(
        f"{name}: expected {wanted or span}, found {show_value(value)}", code="number-impossible"
    )


class SplitRecipe(Record):
    """How buildings are assigned to splits.

    Attributes:
        method: `ratios`; `official`, which uses the source's val split as test and takes val from
            its train split; or `folds` for cross-validation.
        seed: seed of the shuffle of the buildings.
        ratios: fractions of train, val and test. Under `official` the third is 0; None under
            `folds`.
        folds: number of folds; None without folds.
    """

    method: Literal["ratios", "official", "folds"] = "ratios"
    seed: Seed = 0
    ratios: tuple[float, float, float] | None = (0.8, 0.1, 0.1)
    folds: int | None = Field(default=None, ge=2, le=10_000)

    @model_validator(mode="after")
    def _fits_its_method(self) -> SplitRecipe:
        ratios = self.ratios or ()
        is_whole = all(0 <= ratio <= 1 for ratio in ratios) and abs(sum(ratios) - 1) <= 1e-9
        if self.method == "folds" and self.folds is None:
            raise ValueError("folds: expected their number, found none")
        if self.method != "folds" and not is_whole:
            raise ValueError(
                f"ratios: expected three numbers of 0 or more that add up to 1; found {self.ratios}"
            )
        return self


class Exploration(Record):
    """How a robot explores a building under the masks `explore` and `tour`.

    A mask hides the fraction f of the objects and shows 1 − f. `not_entered` and `searched` say how
    much of both lies in whole rooms. The rest is in partly seen rooms. The other masks are
    special cases: see `bsg_data.observation.masks`.
    """

    # share of the hidden objects that is in rooms not entered: (low, high); each draw takes one
    # value, uniformly
    not_entered: tuple[Fraction, Fraction] = (0.0, 1.0)
    # share of the shown objects that is in searched rooms: (low, high), uniformly
    searched: tuple[Fraction, Fraction] = (0.0, 1.0)
    # share of the objects in the rooms found that `tour` hides: (low, high), uniformly
    hidden: tuple[Fraction, Fraction] = (0.3, 0.7)
    # probability that a room was seen through the door, if the robot entered a neighbour of it but
    # not the room itself
    glimpsed: Fraction = 0.5
    # hidden share of such a room: (low, high), uniformly
    glimpsed_share: tuple[Fraction, Fraction] = (0.7, 0.98)
    # how much the hidden shares of partly seen rooms differ: uniformly, by at most spread · min(b,
    # 1 − b) from their mean b; 0: not at all
    spread: float = Field(default=0.8, ge=0.0, lt=1.0)
    # whether the robot enters room after room along the connections; otherwise the rooms are
    # scattered
    connected: bool = True
    # whether the rooms of one share s lose exactly ⌊s · their objects⌋ together, as in the paper's
    # mask. Otherwise each object is hidden with the probability s.
    exact: bool = False

    @model_validator(mode="after")
    def _ranges_rise(self) -> Exploration:
        for name in ("not_entered", "searched", "hidden", "glimpsed_share"):
            low, high = getattr(self, name)
            if low > high:
                raise ValueError(f"{name}: expected low ≤ high, found {[low, high]}")
        return self


class MaskRecipe(Record):
    """How objects are hidden. Recipe, scene and draw number determine a mask.

    Attributes:
        strategy: a name of `bsg_data.observation.masks.MASKS`; `uniform` is the paper's.
        fraction: mean share of a building's objects that the mask hides, 0..1; under `tour` the
            fraction of its rooms that the robot has found.
        rooms: number of rooms that the robot has found under `tour`, instead of the fraction; a
            smaller building is found whole.
        seed: seed of the generator.
        withhold: probability that a class is withheld, for each class independently. A withheld
            class is shown only in searched rooms.
        detector: probability that the robot's detector knows only some of the classes and words,
            any fraction of them; what it does not know is not seen in any room, searched or not.
        parts: whether an object outside the classes is hidden with the object that it is a part of
            (`bsg_data.scene.class_space.find_wholes`).
        exploration: further settings of `explore` and `tour`.
    """

    strategy: str = Field(default="uniform", pattern=r"^[a-z][a-z0-9-]*$")
    fraction: Fraction = 0.5
    rooms: int | None = Field(default=None, ge=1)
    seed: Seed = 0
    withhold: Fraction = 0.0
    detector: Fraction = 0.0
    parts: bool = False
    exploration: Exploration = Exploration()

    @field_validator("rooms")
    @classmethod
    def _a_tour_finds_rooms(cls, rooms: int | None, info: ValidationInfo) -> int | None:
        strategy = info.data.get("strategy", "tour")
        if rooms and strategy != "tour":
            raise ValueError(
                f"is the number that the mask tour finds, and {strategy} finds all; leave it out"
            )
        return rooms

    def __str__(self) -> str:
        """Describe the recipe in words, without its seed and without default values.

        >>> str(MaskRecipe(strategy="explore", withhold=0.2, parts=True))
        'explore, fraction 0.5, withhold 0.2, parts'
        """
        found = f"{self.rooms} rooms" if self.rooms else f"fraction {self.fraction}"
        words = [self.strategy, found]
        words += [f"withhold {self.withhold}"] if self.withhold else []
        words += [f"detector {self.detector}"] if self.detector else []
        words += ["parts"] if self.parts else []
        words += ["exploration of its own"] if self.exploration != Exploration() else []
        return ", ".join(words)


class PairsRecipe(Record):
    """How pairs are drawn: a mask, and a number of draws per building.

    Attributes:
        mask: how objects are hidden.
        draws: masks per building.
    """

    mask: MaskRecipe = MaskRecipe()
    draws: int = Field(default=10, ge=1, le=1_000_000)
