"""Errors of `bsg_models` that several rooms raise. `bsg_data.errors` draws the tree of all."""

from __future__ import annotations

from bsg_data.errors import BSGError, RecipeError


class ConfigError(RecipeError):
    """Report a configuration that cannot be run, with the path of the key."""


class CheckpointError(BSGError):
    """Report a checkpoint that cannot be loaded."""


class PredictionError(BSGError):
    """Report an answer that cannot be used: not finite, or a file of predictions that is faulty."""


class TrainingError(BSGError):
    """Report a training that cannot start or go on."""


class BeliefFileError(BSGError):
    """Report a belief graph that cannot be read or written."""


class HydraError(BeliefFileError):
    """Report a Spark-DSG file that cannot be read or written."""
