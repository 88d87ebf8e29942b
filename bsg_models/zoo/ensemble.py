"""An ensemble: the mixture of what other models believe."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Literal

import numpy.typing as npt
from pydantic import Field, model_validator

from bsg_data.arrays import Ints
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution, blend
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import State, require_same_shapes
from bsg_models.zoo.networks import ANY_MASK
from bsg_models.zoo.settings import ModelConfig


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

    @property
    def reads_labels(self) -> bool:
        """Whether a member reads room labels."""
        return any(member.reads_labels for member in self.members.values())

    def state(self) -> State:
        """Return its calibration, and what each member has learned."""
        state = dict(super().state())
        for name, member in self.members.items():
            state |= {f"members.{name}.{key}": values for key, values in member.state().items()}
        return state

    def load_state(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take its calibration, and let each member take its part."""
        remaining = dict(state)
        for name, member in self.members.items():
            prefix = f"members.{name}."
            keys = [key for key in remaining if key.startswith(prefix)]
            member.load_state({key.removeprefix(prefix): remaining.pop(key) for key in keys})
        require_same_shapes(super().state(), remaining)
        self.hold(**remaining)

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the mixture of the members' distributions."""
        parts = [member.predict(seen).hidden_counts for member in self.members.values()]
        return blend(parts, [1 / len(parts)] * len(parts))

    def learned_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the mixture of the members' beliefs about some rooms."""
        parts = [member.predict_rooms(seen, rows) for member in self.members.values()]
        return blend(parts, [1 / len(parts)] * len(parts))


ENSEMBLE = ZooRow(EnsembleConfig(), Ensemble, data=ANY_MASK)
