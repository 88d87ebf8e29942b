"""Make new models from configurations; an ensemble is the mixture of its members."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy.typing as npt
from pydantic import Field, model_validator

from bsg_data.arrays import Ints
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution, blend
from bsg_models.errors import ConfigError
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.catalogue import ZOO, ZooRow
from bsg_models.zoo.config import RunConfig, find_config
from bsg_models.zoo.model import BeliefModel, ModelInputs, State, require_same_shapes
from bsg_models.zoo.settings import ANY_MASK, ModelConfig


class EnsembleConfig(ModelConfig):
    """Several models of the zoo, whose distributions are mixed."""

    family: Literal["ensemble"] = "ensemble"
    # Names of the zoo; each is trained by its own recipe.
    members: tuple[str, ...] = Field(default=("mixture", "universal"), min_length=1)
    calibrate: bool = True  # the mixture, on the val buildings

    @model_validator(mode="after")
    def _members_differ(self) -> EnsembleConfig:
        if len(set(self.members)) < len(self.members):
            raise ValueError(f"members must differ, found {', '.join(self.members)}")
        return self


class Ensemble(CalibratedModel):
    """P(hidden) = mean over the members of their P(hidden).

    If the members agree, it is as confident as they are; if they differ, it is less so.
    """

    config: EnsembleConfig

    def __init__(self, config: EnsembleConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.members: dict[str, BeliefModel] = {}

    @property
    def reads_labels(self) -> bool:
        """Whether a member reads room labels."""
        return any(member.reads_labels for member in self.members.values())

    def state(self) -> State:
        """Return its calibration, and what each member has learned."""
        every = dict(super().state())
        for name, member in self.members.items():
            every |= {f"members.{name}.{key}": one for key, one in member.state().items()}
        return every

    def load_state(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take its calibration, and let each member take its part."""
        rest = dict(state)
        for name, member in self.members.items():
            prefix = f"members.{name}."
            own = [key for key in rest if key.startswith(prefix)]
            member.load_state({key.removeprefix(prefix): rest.pop(key) for key in own})
        require_same_shapes(super().state(), rest)
        self.hold(**rest)

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the mixture of the members' distributions."""
        parts = [member.predict(seen).hidden_counts for member in self.members.values()]
        return blend(parts, [1 / len(parts)] * len(parts))

    def learned_rooms(
        self, seen: Observation, rows: Ints, columns: Ints | None
    ) -> CountDistribution:
        """Return the mixture of the members' beliefs about some rooms."""
        parts = [member.predict_rooms(seen, rows, columns) for member in self.members.values()]
        return blend(parts, [1 / len(parts)] * len(parts))


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


def is_by_seed(config: RunConfig) -> bool:
    """Return whether another seed may train another model; an ensemble counts as such."""
    return bool(getattr(ZOO[config.model.family].make, "by_seed", True))


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


ENSEMBLE = ZooRow(EnsembleConfig(), Ensemble, data=ANY_MASK)
