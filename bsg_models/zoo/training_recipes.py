"""How models of the zoo are trained, beside the paper's recipe, which is the default."""

from __future__ import annotations

from bsg_models.zoo.settings import DataConfig, TrainingConfig

# The visible share varies, so that a model answers at any.
VARIED = DataConfig(fractions=(0.1, 0.9))
# Every room sees every other.
CONNECTED = DataConfig(fractions=(0.1, 0.9), edges=("complete",))
# For a search, which knows all of some rooms and nothing of its artifact in the others.
SEARCHING = DataConfig(fractions=(0.1, 0.9), withhold=0.08, edges=("complete",))
# For networks of hidden counts.
COUNTS = TrainingConfig(
    epochs=400,
    batch_size=32,
    learning_rate=0.002,
    decay=0.02,
    decay_as="decoupled",
    schedule="one-cycle",
    clip=5.0,
    validate_every=20,
)
