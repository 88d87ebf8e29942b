"""Define the errors of `bsg_models`; `bsg_data.errors` shows the tree of all errors."""

from __future__ import annotations

from bsg_data.errors import BSGError, RecipeError


class ConfigError(RecipeError):
    """Report an invalid configuration, with the path of the key."""


class CheckpointError(BSGError):
    """Report a checkpoint that cannot be loaded."""


class PredictionError(BSGError):
    """Report a prediction that cannot be used: not finite, or in a faulty file of predictions."""


class TrainingError(BSGError):
    """Report a training that cannot start or continue."""
