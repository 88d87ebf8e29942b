"""Every error that `bsg_models` raises on purpose, besides those of `bsg_data`.

BSGError                bsg_data.errors
├── ConfigError         (a RecipeError) a configuration names something that is not, or cannot be
├── CheckpointError     a checkpoint is missing, damaged, or of another shape or run
├── PredictionError     a model's answer is no number
└── TrainingError       a training cannot start or go on
"""

from __future__ import annotations

from bsg_data.errors import BSGError, RecipeError


class ConfigError(RecipeError):
    """Report a configuration that cannot be run, with the path of the key."""


class CheckpointError(BSGError):
    """Report a checkpoint that cannot be loaded."""


class PredictionError(BSGError):
    """Report a model whose answer is not finite."""


class TrainingError(BSGError):
    """Report a training that cannot start or go on."""
