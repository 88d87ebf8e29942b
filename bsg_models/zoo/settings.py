"""Settings: what a model, its data and its training depend on. They import nothing heavy."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, field_validator, model_validator

from bsg_data.observation.masks import MASKS
from bsg_data.recipes import MaskRecipe, Record
from bsg_models.inputs.edges import EdgeSet

Device = Literal["auto", "cpu", "cuda"]
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
            stored pairs, as the paper does. Test takes stored pairs, and so does validation unless
            the fresh masks are of another kind: see `needs_own_masks`.
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
    def _fractions_rise(self) -> DataConfig:
        if self.fractions and self.fractions[0] > self.fractions[1]:
            raise ValueError(f"fractions must rise, found {list(self.fractions)}")
        return self

    @model_validator(mode="after")
    def _search_masks_are_fresh(self) -> DataConfig:
        if self.withhold and (self.masks, self.mask.strategy) != ("fresh", "uniform"):
            raise ValueError(
                "withhold needs fresh masks of the strategy uniform, which it makes those of "
                "searches; for others set mask.withhold"
            )
        return self

    @property
    def own_strategy(self) -> str | None:
        """The kind of mask that it asks for by name; None of the default, which studies replace."""
        return None if self.mask.strategy == "uniform" else self.mask.strategy

    def under(self, mask: MaskRecipe) -> DataConfig:
        """Return the choice with another mask, as studies set it.

        A mask of another strategy than `uniform` takes the classes that are withheld into itself.
        """
        if not self.withhold or mask.strategy == "uniform":
            return self.model_copy(update={"mask": mask})
        withheld = mask.model_copy(update={"withhold": self.withhold})
        return self.model_copy(update={"mask": withheld, "withhold": 0.0})

    def needs_own_masks(self, stored: MaskRecipe | None) -> bool:
        """Say whether validation draws masks of its own, because stored pairs would mislead it.

        Fresh masks of another strategy than `uniform`, or that withhold classes, are of another
        kind than stored pairs, unless these were drawn by the same recipe; its fraction and its
        seed aside. Which epoch is the best, and how sure the model may be, is then found on the
        kind of mask that it is trained for.

        Args:
            stored: mask of the stored pairs; None if there are none.
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
        device: what the steps are computed on: `cpu`, `cuda`, or `auto` for a GPU if there is one.
            Validation is on the CPU, and checkpoints load anywhere.
    """

    epochs: int = Field(default=5000, ge=1)
    batch_size: int = Field(default=24, ge=1)
    learning_rate: float = Field(default=0.01, gt=0, allow_inf_nan=False)
    decay: float = Field(default=5e-6, ge=0, allow_inf_nan=False)
    decay_as: Literal["weight-decay", "learning-rate", "decoupled"] = "weight-decay"
    schedule: Literal["constant", "one-cycle"] = "constant"
    clip: float | None = Field(default=None, gt=0, allow_inf_nan=False)
    validate_every: int = Field(default=10, ge=1)
    device: Device = "cpu"
