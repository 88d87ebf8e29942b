"""All models on one screen: a name stands for a configuration."""

from __future__ import annotations

import difflib
from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any

from bsg_models.errors import ConfigError
from bsg_models.zoo.baselines import DoubledModel, InputModel, TrainMeanModel
from bsg_models.zoo.boosting import PoissonBoosting
from bsg_models.zoo.conditional import ConditionalModel
from bsg_models.zoo.config import DataConfig, RunConfig, TrainingConfig
from bsg_models.zoo.deepsets import DeepSets
from bsg_models.zoo.ensemble import Ensemble
from bsg_models.zoo.families import (
    BoostingConfig,
    ConditionalConfig,
    DeepSetsConfig,
    DoubledConfig,
    EnsembleConfig,
    GammaPoissonConfig,
    GATConfig,
    GCNConfig,
    GINConfig,
    InputConfig,
    MixtureConfig,
    NaiveBayesConfig,
    Reading,
    ResidualGCNConfig,
    RoomTransformerConfig,
    SAGEConfig,
    TrainMeanConfig,
)
from bsg_models.zoo.gamma_poisson import GammaPoissonModel
from bsg_models.zoo.gat import CECIGAT
from bsg_models.zoo.gcn import CECIGCN
from bsg_models.zoo.gin import CECIGIN
from bsg_models.zoo.mixture import RoomTypeMixture
from bsg_models.zoo.model import BeliefModel
from bsg_models.zoo.naive_bayes import NaiveBayesModel
from bsg_models.zoo.residual_gcn import ResidualGCN
from bsg_models.zoo.room_transformer import RoomTransformer
from bsg_models.zoo.sage import CECISAGE

# How networks of hidden counts are trained; the paper's own recipe is TrainingConfig's default.
# The visible share varies, so that they answer at any; CONNECTED lets every room see every other.
VARIED = DataConfig(fractions=(0.1, 0.9))
CONNECTED = DataConfig(fractions=(0.1, 0.9), edges=("complete",))
# Trained for a search, which knows all of some rooms and nothing of its artifact in the others.
SEARCHING = DataConfig(fractions=(0.1, 0.9), withhold=0.08, edges=("complete",))
TOLD: tuple[Reading, ...] = ("mask", "building", "categories", "withheld")
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

ZOO: Mapping[str, RunConfig] = MappingProxyType(
    {
        "input": RunConfig(model=InputConfig()),
        "doubled": RunConfig(model=DoubledConfig()),
        "train-mean": RunConfig(model=TrainMeanConfig()),
        "conditional": RunConfig(model=ConditionalConfig()),
        "gamma-poisson": RunConfig(model=GammaPoissonConfig()),
        "naive-bayes": RunConfig(model=NaiveBayesConfig()),
        "mixture": RunConfig(model=MixtureConfig()),
        "poisson-boosting": RunConfig(model=BoostingConfig(), data=VARIED),
        "ceci-gcn": RunConfig(model=GCNConfig()),
        "ceci-gcn-residual": RunConfig(model=ResidualGCNConfig(), data=VARIED, training=COUNTS),
        "ceci-sage": RunConfig(model=SAGEConfig(), data=CONNECTED, training=COUNTS),
        "ceci-gat": RunConfig(model=GATConfig(), data=CONNECTED, training=COUNTS),
        "ceci-gin": RunConfig(model=GINConfig(), data=VARIED, training=COUNTS),
        "deepsets": RunConfig(model=DeepSetsConfig(), data=VARIED, training=COUNTS),
        "room-transformer": RunConfig(model=RoomTransformerConfig(), data=VARIED, training=COUNTS),
        "ensemble": RunConfig(model=EnsembleConfig()),
        "search-sage": RunConfig(model=SAGEConfig(reads=TOLD), data=SEARCHING, training=COUNTS),
    }
)
BASELINES = ("input", "doubled", "train-mean", "gamma-poisson")

_FAMILIES: Mapping[str, Callable[[Any, int, tuple[str, ...]], BeliefModel]] = MappingProxyType(
    {
        "input": lambda config, classes, vocabulary: InputModel(),
        "doubled": lambda config, classes, vocabulary: DoubledModel(),
        "train-mean": lambda config, classes, vocabulary: TrainMeanModel(classes),
        "conditional": lambda config, classes, vocabulary: ConditionalModel(config, classes),
        "gamma-poisson": lambda config, classes, vocabulary: GammaPoissonModel(classes),
        "naive-bayes": lambda config, classes, vocabulary: NaiveBayesModel(config, classes),
        "mixture": lambda config, classes, vocabulary: RoomTypeMixture(config, classes),
        "poisson-boosting": PoissonBoosting,
        "ceci-gcn": lambda config, classes, vocabulary: CECIGCN(config, classes),
        "ceci-gcn-residual": ResidualGCN,
        "ceci-sage": CECISAGE,
        "ceci-gat": CECIGAT,
        "ceci-gin": CECIGIN,
        "deepsets": DeepSets,
        "room-transformer": RoomTransformer,
    }
)


def find_config(name: str) -> RunConfig:
    """Return the configuration of a zoo name.

    Raises:
        ConfigError: for an unknown name, listing the names.
    """
    if name not in ZOO:
        near = difflib.get_close_matches(name, ZOO, n=1)
        hint = f"; did you mean {near[0]}?" if near else "."
        raise ConfigError(f"no model {name!r}{hint} Known are {', '.join(ZOO)}")
    return ZOO[name]


def find_member(name: str) -> RunConfig:
    """Return the configuration of a member of an ensemble.

    Raises:
        ConfigError: for an unknown name, or an ensemble.
    """
    config = find_config(name)
    if isinstance(config.model, EnsembleConfig):
        raise ConfigError(f"{name} is an ensemble itself; name its members instead")
    return config


def reads_categories(config: RunConfig) -> bool:
    """Say whether a model reads the visible objects outside the classes."""
    if isinstance(config.model, EnsembleConfig):
        return any(reads_categories(find_member(name)) for name in config.model.members)
    return "categories" in getattr(config.model, "reads", ())


def make_model(
    config: RunConfig,
    *,
    classes: int,
    vocabulary: tuple[str, ...] = (),
    members: Mapping[str, RunConfig] | None = None,
) -> BeliefModel:
    """Return a new model of a configuration.

    Args:
        config: of the run.
        classes: C, of the histograms.
        vocabulary: the categories outside the classes that it may read.
        members: recipes of an ensemble's members, where they are not those of the zoo.

    Raises:
        ConfigError: if an ensemble names a member that is none.
    """
    if isinstance(config.model, EnsembleConfig):
        recipes = {
            name: (members or {}).get(name) or find_member(name) for name in config.model.members
        }
        return Ensemble(
            {
                name: make_model(recipe, classes=classes, vocabulary=vocabulary)
                for name, recipe in recipes.items()
            },
            {name: recipe.data.edges for name, recipe in recipes.items()},
            vocabulary,
        )
    reads = vocabulary if reads_categories(config) else ()
    return _FAMILIES[config.model.family](config.model, classes, reads)
