"""Define how models of the zoo are trained, besides the paper's recipe, which is the default."""

from __future__ import annotations

from bsg_data.recipes import MaskRecipe
from bsg_models.zoo.node_features import Reading
from bsg_models.zoo.settings import DataConfig, TrainingConfig

# The visible share varies, so that a model works at any share.
VARIED = DataConfig(fractions=(0.1, 0.9))
# Every room sees every other.
CONNECTED = DataConfig(fractions=(0.1, 0.9), edges=("complete",))
# Any observation: every kind of mask in turn, sometimes with withheld classes, as in a search.
WHATEVER = DataConfig(
    mask=MaskRecipe(strategy="mixed", withhold=0.05), fractions=(0.1, 0.9), edges=("complete",)
)
# All evidence that a robot may have of a room; unknown evidence is left out.
EVERYTHING: tuple[Reading, ...] = (
    "mask",
    "building",
    "categories",
    "withheld",
    "size",
    "labels",
    "kind",
    "source",
)
# For networks of hidden counts.
COUNTS = TrainingConfig(
    epochs=160,
    batch_size=32,
    learning_rate=0.002,
    decay=0.02,
    decay_as="decoupled",
    schedule="one-cycle",
    clip=5.0,
    validate_every=20,
)
