"""List all models: each name stands for a model with its configuration.

This module imports no model, so names can be listed without torch.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from bsg_data.registry import Registry
from bsg_models.zoo.settings import DataConfig, ModelConfig, TrainingConfig


@dataclass(frozen=True)
class ZooRow:
    """A model of the zoo."""

    config: ModelConfig  # the model's own settings
    make: Callable[..., Any]  # its `BeliefModel`, called with such settings and `ModelInputs`
    data: DataConfig = DataConfig()
    training: TrainingConfig = TrainingConfig()  # models fitted by counting ignore it
    summary: str = ""  # if empty, the first line of the docstring of the settings

    def __post_init__(self) -> None:
        if not isinstance(self.config, ModelConfig):
            raise TypeError(f"ZooRow: config is {self.config!r}, expected an instance of its class")

    def describe(self) -> str:
        """Return a description of the model in one line."""
        return self.summary or (type(self.config).__doc__ or "").strip().splitlines()[0]


ZOO: Registry[ZooRow] = Registry(
    "model",
    ZooRow,
    group="bsg_models.zoo",
    rows={
        "ceci": "bsg_models.ceci.gcn:ROW",
        "input": "bsg_models.zoo.baselines:INPUT",
        "doubled": "bsg_models.zoo.baselines:DOUBLED",
        "train-mean": "bsg_models.zoo.baselines:TRAIN_MEAN",
        "gamma-poisson": "bsg_models.zoo.gamma_poisson:GAMMA_POISSON",
        "tilted-gamma-poisson": "bsg_models.zoo.gamma_poisson:TILTED_GAMMA_POISSON",
        "mixture": "bsg_models.zoo.mixture:MIXTURE",
        "ceci-sage": "bsg_models.zoo.networks:CECI_SAGE",
        "ensemble": "bsg_models.zoo.ensemble:ENSEMBLE",
        "universal": "bsg_models.zoo.networks:UNIVERSAL",
    },
)
# What `--config` takes besides: a model of the zoo, and settings of it.
RECIPES: dict[str, tuple[str, dict[str, Any]]] = {
    "paper": ("ceci", {}),
    "quick": ("ceci", {"name": "ceci-60", "training": {"epochs": 60, "validate_every": 2}}),
}
BASELINES = ("input", "doubled", "train-mean", "gamma-poisson")
UNTRAINED = BASELINES[:2]  # learn nothing
