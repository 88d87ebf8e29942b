"""Several models as one: the equal mixture of their distributions of the hidden counts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import cast

import torch
from torch import nn
from torch_geometric.data import Data

from bsg_models.belief.count_distribution import CountDistribution, blend
from bsg_models.inputs.graphs import EdgeSet, reconnect
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.model import BeliefModel


class Ensemble(CalibratedModel):
    """P(hidden) = mean over the members of their P(hidden).

    Where members agree it is as sure as they are; where they differ it is less so.
    """

    def __init__(
        self,
        members: Mapping[str, BeliefModel],
        edges: Mapping[str, tuple[EdgeSet, ...]],
        vocabulary: tuple[str, ...],
    ) -> None:
        super().__init__()
        self.vocabulary = vocabulary
        self.edges = dict(edges)  # every member was trained on graphs with its own
        self.members = nn.ModuleDict(dict(members))

    def take_member(self, name: str, trained: BeliefModel) -> None:
        """Put a trained model in a member's place."""
        self.members[name] = trained

    def resize_buffers(self, state: Mapping[str, torch.Tensor]) -> None:
        """Prepare every member for its part of a checkpoint."""
        for name, member in self._each():
            prefix = f"members.{name}."
            own = {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
            member.resize_buffers(own)

    def predict_hidden_counts(self, graphs: Data) -> CountDistribution:
        """Return the mixture of the members' distributions."""
        distributions = [
            member.predict(reconnect(graphs, self.edges[name])).hidden_counts
            for name, member in self._each()
        ]
        return blend(distributions, [1 / len(distributions)] * len(distributions))

    def _each(self) -> Iterator[tuple[str, BeliefModel]]:
        for name, member in self.members.items():
            yield name, cast(BeliefModel, member)
