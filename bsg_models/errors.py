"""Every error that `bsg_models` raises on purpose, besides those of `bsg_data`.

BSGError                bsg_data.errors
├── ConfigError         (a RecipeError) a configuration names something that is not, or cannot be
├── CheckpointError     a checkpoint is missing, damaged, or of another shape or run
├── TrainingError       a training cannot start or go on
└── BeliefFileError     a belief graph cannot be read from a file, or written to one
    └── HydraError      a Spark-DSG file cannot be read or written
"""

from __future__ import annotations

from bsg_data.errors import BSGError, RecipeError


class ConfigError(RecipeError):
    """Report a configuration that cannot be run, with the path of the key."""


class CheckpointError(BSGError):
    """Report a checkpoint that cannot be loaded."""


class TrainingError(BSGError):
    """Report a training that cannot start or go on."""


class BeliefFileError(BSGError):
    """Report a belief graph that cannot be read or written."""


class HydraError(BeliefFileError):
    """Report a Spark-DSG file that cannot be read or written."""
