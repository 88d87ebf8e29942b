"""Several models as one: the equal mixture of their laws of the hidden counts."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import cast

import torch
from torch import nn
from torch_geometric.data import Data

from bsg_models.calibration import CalibratedModel
from bsg_models.graph_dataset import EdgeSet, reconnect
from bsg_models.hidden_counts import HiddenCounts, blend
from bsg_models.model import BeliefModel


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

    def make_room(self, state: Mapping[str, torch.Tensor]) -> None:
        """Prepare every member for its part of a checkpoint."""
        for name, member in self._each():
            prefix = f"members.{name}."
            own = {k.removeprefix(prefix): v for k, v in state.items() if k.startswith(prefix)}
            member.make_room(own)

    def believe(self, graphs: Data) -> HiddenCounts:
        """Return the mixture of the members' laws."""
        laws = [
            member.predict(reconnect(graphs, self.edges[name])).law for name, member in self._each()
        ]
        return blend(laws, [1 / len(laws)] * len(laws))

    def _each(self) -> Iterator[tuple[str, BeliefModel]]:
        for name, member in self.members.items():
            yield name, cast(BeliefModel, member)
