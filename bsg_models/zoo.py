"""All models on one screen: a name stands for a configuration."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from bsg_models.baselines import DoubledModel, InputModel, TrainMeanModel
from bsg_models.config import (
    DoubledConfig,
    GammaPoissonConfig,
    GCNConfig,
    InputConfig,
    RunConfig,
    TrainMeanConfig,
)
from bsg_models.errors import ConfigError
from bsg_models.gamma_poisson import GammaPoissonModel
from bsg_models.gcn import CECIGCN
from bsg_models.model import BeliefModel

ZOO: Mapping[str, RunConfig] = MappingProxyType(
    {
        "input": RunConfig(model=InputConfig()),
        "doubled": RunConfig(model=DoubledConfig()),
        "train-mean": RunConfig(model=TrainMeanConfig()),
        "gamma-poisson": RunConfig(model=GammaPoissonConfig()),
        "ceci-gcn": RunConfig(model=GCNConfig()),
    }
)
BASELINES = ("input", "doubled", "train-mean", "gamma-poisson")

_FAMILIES: Mapping[str, Callable[[Any, int], BeliefModel]] = MappingProxyType(
    {
        "input": lambda config, classes: InputModel(),
        "doubled": lambda config, classes: DoubledModel(),
        "train-mean": lambda config, classes: TrainMeanModel(classes),
        "gamma-poisson": lambda config, classes: GammaPoissonModel(classes),
        "ceci-gcn": CECIGCN,
    }
)


def find_config(name: str) -> RunConfig:
    """Return the configuration of a zoo name.

    Raises:
        ConfigError: for an unknown name, listing the names.
    """
    if name not in ZOO:
        near = difflib.get_close_matches(name, ZOO, n=1)
        hint = f"; did you mean {near[0]}?" if near else ""
        raise ConfigError(f"no model {name!r}{hint} Known are {', '.join(ZOO)}")
    return ZOO[name]


def make_model(config: RunConfig, *, classes: int) -> BeliefModel:
    """Return a new model of a configuration for histograms of `classes` classes."""
    return _FAMILIES[config.model.family](config.model, classes)
