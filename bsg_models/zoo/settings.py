"""The settings of models, data and training, without heavy imports."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from bsg_data.observation.masks import MASKS
from bsg_data.recipes import MaskRecipe
from bsg_data.records import Record
from bsg_models.inputs.nodes import EdgeSet

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
    # Short for a `mask` of the strategy `search` with this `withhold`: of each training building up
    # to half of the rooms were searched, and the others show no object of the withheld classes.
    withhold: Share = 0.0
    fold: int | None = Field(default=None, ge=0)  # to test on, in a dataset of folds

    @field_validator("mask")
    @classmethod
    def _strategy_exists(cls, mask: MaskRecipe) -> MaskRecipe:
        MASKS.require([mask.strategy])
        return mask

    @model_validator(mode="after")
    def _fractions_rise(self) -> DataConfig:
        if self.fractions and self.fractions[0] > self.fractions[1]:
            raise ValueError(f"fractions must rise, found {list(self.fractions)}")
        return self

    @model_validator(mode="after")
    def _search_masks_are_fresh(self) -> DataConfig:
        if self.withhold and (self.masks, self.mask.strategy) != ("fresh", "uniform"):
            raise ValueError(
                "withhold needs fresh masks of the strategy uniform, which it turns into those of "
                "searches; for other strategies set mask.withhold"
            )
        return self

    @property
    def own_strategy(self) -> str | None:
        """The kind of mask that it names; None for the default, which studies replace."""
        return None if self.mask.strategy == "uniform" else self.mask.strategy

    def under(self, mask: MaskRecipe) -> DataConfig:
        """Return the choice with another mask, as studies set it.

        A mask of a strategy other than `uniform` takes over the withheld classes.
        """
        if not self.withhold or mask.strategy == "uniform":
            return self.model_copy(update={"mask": mask})
        withheld = mask.model_copy(update={"withhold": self.withhold})
        return self.model_copy(update={"mask": withheld, "withhold": 0.0})

    def needs_own_masks(self, stored: MaskRecipe | None) -> bool:
        """Return whether the stored pairs, if any, show another kind of mask than the training.

        Validation then draws its own, so that the best epoch and the calibration are chosen on the
        kind of mask that the model is trained for. Fraction and seed may differ.
        """
        mask = self.fresh_mask
        if self.masks == "fixed" or (mask.strategy == "uniform" and not mask.withhold):
            return False
        aside = {"fraction": mask.fraction, "seed": mask.seed}
        return stored is None or stored.model_copy(update=aside) != mask

    @property
    def fresh_mask(self) -> MaskRecipe:
        """The recipe of the fresh masks; with `withhold` they are those of searches."""
        if not self.withhold:
            return self.mask
        return self.mask.model_copy(update={"strategy": "search", "withhold": self.withhold})


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


# Every room sees every other, and the visible share varies: a model then works at any share.
CONNECTED = DataConfig(fractions=(0.1, 0.9), edges=("complete",))
# Any observation: every kind of mask in turn, sometimes with withheld classes, as in a search, or
# with a detector of few words.
# Words of fewer buildings mislead: with a coat rack in nine, a hall was taken for a bathroom.
ANY_MASK = DataConfig(
    mask=MaskRecipe(strategy="mixed", withhold=0.05, detector=0.25),
    fractions=(0.1, 0.9),
    edges=("complete",),
    min_scenes=10,
)
# How networks of hidden counts are trained.
COUNT_TRAINING = TrainingConfig(
    epochs=160,
    batch_size=32,
    learning_rate=0.002,
    decay=0.02,
    decay_as="decoupled",
    schedule="one-cycle",
    clip=5.0,
    validate_every=20,
)
# Of a building that is being found there are more views than of a whole one.
LONG_TRAINING = COUNT_TRAINING.model_copy(update={"epochs": 280})
