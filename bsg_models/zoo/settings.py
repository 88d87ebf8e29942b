"""The settings of models, data and training, without heavy imports."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from bsg_data.recipes import MaskRecipe
from bsg_data.records import Record

# `up` from rooms to the building, `down` from it to rooms, both ways between rooms that are known
# to connect (`adjacent`), or between all rooms of a building (`complete`).
EdgeSet = Literal["up", "down", "adjacent", "complete"]
Device = Literal["auto", "cpu", "cuda"]
Share = Annotated[float, Field(ge=0, le=1)]


class ModelConfig(Record):
    """Settings of a model; each family has its own, with the measured values as defaults.

    Lists of models show the first line of a family's docstring.
    """

    family: str  # a row of `bsg_models.zoo.catalogue.ZOO`


class DataConfig(Record):
    """What a run is trained on."""

    # `fresh` draws new masks of the training buildings each epoch; `fixed` uses the stored pairs,
    # as the paper does. Tests use stored pairs. Validation does, too, unless `needs_own_masks`.
    masks: Literal["fresh", "fixed"] = "fresh"
    mask: MaskRecipe = MaskRecipe()  # of the fresh masks
    # Range of the fraction of the fresh masks, instead of the mask's own: a model trained at one
    # fraction only is unreliable at others.
    fractions: tuple[Share, Share] | None = None
    edges: tuple[EdgeSet, ...] = ("up", "down")
    # Training buildings in which a category outside the classes must occur to be read.
    min_scenes: int = Field(default=4, ge=1)
    fold: int | None = Field(default=None, ge=0)  # to test on, in a dataset of folds

    @field_validator("mask")
    @classmethod
    def _strategy_exists(cls, mask: MaskRecipe) -> MaskRecipe:
        from bsg_data.observation.masks import MASKS  # settings are listed without NumPy

        MASKS.require([mask.strategy])
        return mask

    @model_validator(mode="after")
    def _fractions_rise(self) -> DataConfig:
        if self.fractions and self.fractions[0] > self.fractions[1]:
            raise ValueError(f"fractions must rise, found {list(self.fractions)}")
        return self

    @property
    def own_strategy(self) -> str | None:
        """The kind of mask that it names; None for the default, which studies replace."""
        return None if self.mask.strategy == "uniform" else self.mask.strategy

    def needs_own_masks(self, stored: MaskRecipe | None) -> bool:
        """Return whether the stored pairs, if any, show another kind of mask than the training.

        Validation then draws its own, so that the best epoch and the calibration are chosen on the
        kind of mask that the model is trained for. Fraction and seed may differ.
        """
        mask = self.mask
        if self.masks == "fixed" or (mask.strategy == "uniform" and not mask.withhold):
            return False
        aside = {"fraction": mask.fraction, "seed": mask.seed}
        return stored is None or stored.model_copy(update=aside) != mask


class TrainingConfig(Record):
    """How a network is trained; the defaults are the paper's values (section IV-A)."""

    epochs: int = Field(default=5000, ge=1)
    batch_size: int = Field(default=24, ge=1)  # graphs per step
    learning_rate: float = Field(default=0.01, gt=0, allow_inf_nan=False)  # of Adam
    # The paper's "learning rate decay of 5e-6": Adam's `weight-decay`, or `learning-rate` / (1 +
    # decay · step), or `decoupled`, which is AdamW's on matrices only and not the paper's.
    decay: float = Field(default=5e-6, ge=0, allow_inf_nan=False)
    decay_as: Literal["weight-decay", "learning-rate", "decoupled"] = "weight-decay"
    # `one-cycle` rises for a tenth of all steps, then falls to 0 as a cosine; the result then
    # depends on `epochs`.
    schedule: Literal["constant", "one-cycle"] = "constant"
    clip: float | None = Field(default=None, gt=0, allow_inf_nan=False)  # norm of the gradients
    # Epochs between validations; they also save what a stopped training goes on from.
    validate_every: int = Field(default=10, ge=1)
    # Stop after so many validations in turn that were no better than the best; None never stops.
    patience: int | None = Field(default=None, ge=1)
    # Of the steps; `auto` takes a GPU if there is one. Validation is on the CPU.
    device: Device = "cpu"
