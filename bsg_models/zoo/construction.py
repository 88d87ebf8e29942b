"""Make new models from configurations; an ensemble is made with its members."""

from __future__ import annotations

from collections.abc import Mapping

from bsg_models.errors import ConfigError
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig, find_config
from bsg_models.zoo.ensemble import Ensemble, EnsembleConfig
from bsg_models.zoo.model import BeliefModel, ModelInputs, Network


def find_member(name: str) -> RunConfig:
    """Return the configuration of a member of an ensemble, which is none itself."""
    config = find_config(name)
    if isinstance(config.model, EnsembleConfig):
        raise ConfigError(f"{name} is an ensemble itself; name its members instead")
    return config


def reads_categories(config: RunConfig) -> bool:
    """Return whether a model reads visible objects outside the classes."""
    if isinstance(config.model, EnsembleConfig):
        return any(reads_categories(find_member(name)) for name in config.model.members)
    return "categories" in getattr(config.model, "reads", ())


def can_resume(config: RunConfig) -> bool:
    """Return whether a stopped training can continue; a training by counting cannot."""
    make = ZOO[config.model.family].make
    return isinstance(make, type) and issubclass(make, Network | Ensemble)


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
        vocabulary: categories outside the classes that it may read.
        members: recipes of an ensemble's members; None for those of the zoo.

    Raises:
        ConfigError: if an ensemble names an unknown member.
    """
    reads = vocabulary if reads_categories(config) else ()
    inputs = ModelInputs(classes=classes, vocabulary=reads, edges=config.data.edges)
    model = ZOO[config.model.family].make(config.model, inputs)
    if isinstance(model, Ensemble):
        for name in model.config.members:
            recipe = (members or {}).get(name) or find_member(name)
            model.members[name] = make_model(recipe, classes=classes, vocabulary=vocabulary)
    return model
