"""Settings: what a model, its data and its training depend on. They import nothing heavy."""

from __future__ import annotations

from typing import Annotated, Literal, Self

from pydantic import Field, field_validator, model_validator

from bsg_data.observation.masks import MASKS
from bsg_data.recipes import MaskRecipe, Record
from bsg_models.inputs.edges import EdgeSet

Share = Annotated[float, Field(ge=0, le=1)]


class ModelConfig(Record):
    """What a model depends on; each family has its own, with the values that it was measured with.

    The first line of its docstring describes the family in lists of models.

    Attributes:
        family: its name, which is a row of `bsg_models.zoo.catalogue.ZOO`.
    """

    family: str


class DataConfig(Record):
    """What a run is trained on.

    Attributes:
        masks: `fresh` draws new masks of the training buildings each epoch; `fixed` takes the
            stored pairs, as the paper does. Validation and test always take stored pairs.
        mask: of the fresh masks.
        fractions: from where to where the fraction of the fresh masks varies, instead of the
            mask's own: a model that met one fraction only is not to be trusted at another.
        edges: which edges the graphs have; see `bsg_models.inputs.edges.connect`.
        min_scenes: training buildings in which a category outside the classes must occur to be
            read, by models that read them.
        withhold: short for a `mask` of the strategy `search` with this `withhold`: of each training
            building up to half of the rooms were searched, and elsewhere no object of the withheld
            classes is shown. Models that read `withheld` are told.
        fold: the fold to test on, in a dataset of folds.
    """

    masks: Literal["fresh", "fixed"] = "fresh"
    mask: MaskRecipe = MaskRecipe()
    fractions: tuple[Share, Share] | None = None
    edges: tuple[EdgeSet, ...] = ("up", "down")
    min_scenes: int = Field(default=4, ge=1)
    withhold: Share = 0.0
    fold: int | None = Field(default=None, ge=0)

    @field_validator("mask")
    @classmethod
    def _strategy_exists(cls, mask: MaskRecipe) -> MaskRecipe:
        MASKS.require([mask.strategy])
        return mask

    @model_validator(mode="after")
    def _fractions_rise(self) -> Self:
        if self.fractions and self.fractions[0] > self.fractions[1]:
            raise ValueError(f"fractions must rise, found {list(self.fractions)}")
        return self

    @model_validator(mode="after")
    def _search_masks_are_fresh(self) -> Self:
        if self.withhold and (self.masks, self.mask.strategy) != ("fresh", "uniform"):
            raise ValueError(
                "withhold needs fresh masks of the strategy uniform, which it makes those of "
                "searches; for others set mask.withhold"
            )
        return self

    @property
    def fresh_mask(self) -> MaskRecipe:
        """The recipe of the fresh masks, with `withhold`; uniform ones are then those of searches.

        A leaderboard gives the mask of a configuration another strategy, which it keeps.
        """
        if not self.withhold:
            return self.mask
        strategy = "search" if self.mask.strategy == "uniform" else self.mask.strategy
        return self.mask.model_copy(update={"strategy": strategy, "withhold": self.withhold})


class TrainingConfig(Record):
    """How a network is trained; the paper's values are the defaults (section IV-A).

    Attributes:
        epochs: the paper's 5000.
        batch_size: graphs a step.
        learning_rate: of Adam.
        decay: the paper's "learning rate decay of 5e-6".
        decay_as: read as Adam's `weight-decay`, or as `learning-rate` / (1 + decay · step); or, not
            the paper's, `decoupled`: AdamW's, on matrices only.
        schedule: a `constant` learning rate, or `one-cycle`: a tenth of all steps up, then down to
            nothing as a cosine; `epochs` is then part of what is learned.
        clip: norm that gradients are cut to; None leaves them.
        validate_every: epochs between validations; each also writes the checkpoints.
    """

    epochs: int = Field(default=5000, ge=1)
    batch_size: int = Field(default=24, ge=1)
    learning_rate: float = Field(default=0.01, gt=0, allow_inf_nan=False)
    decay: float = Field(default=5e-6, ge=0, allow_inf_nan=False)
    decay_as: Literal["weight-decay", "learning-rate", "decoupled"] = "weight-decay"
    schedule: Literal["constant", "one-cycle"] = "constant"
    clip: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    validate_every: int = Field(default=10, ge=1)
