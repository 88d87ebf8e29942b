"""CECI with GraphSAGE: separate weights for a node's features and the mean of its neighbours'."""

from __future__ import annotations

from typing import Literal

import torch
from torch import nn
from torch_geometric.nn import SAGEConv

from bsg_data.observation.observation import Observation
from bsg_models.inputs.nodes import Neighbours, Nodes
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.count_network import CountNetwork
from bsg_models.zoo.features import EVERYTHING, NetworkConfig, ShownDropout
from bsg_models.zoo.gcn import WritesNoFile
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import CONNECTED, COUNTS, WHATEVER


class SAGEConfig(NetworkConfig):
    """GraphSAGE between building and rooms."""

    family: Literal["ceci-sage"] = "ceci-sage"


class MeanConv(WritesNoFile, SAGEConv):  # type: ignore[misc]
    """PyG's convolution, by `Neighbours` instead of a list of edges."""

    def forward(self, x: torch.Tensor, neighbours: Neighbours) -> torch.Tensor:
        """Return W₁ (mean of the neighbours) + W₂ x, `[N, width]`."""
        convolved: torch.Tensor = self.lin_l(neighbours.mean(x)) + self.lin_r(x)
        return convolved


class CECISAGE(CountNetwork):
    """`depth` rounds of h ← h + dropout(SiLU(norm(W₁ mean of the neighbours + W₂ h))).

    The mean is that of GraphSAGE (Hamilton et al., 2017). The residual sum keeps a node's own
    information: without it, rounds of averaging over a star of rooms make the rooms alike.
    """

    def __init__(self, config: SAGEConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.enter = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.mask),
            nn.Linear(self.features.width, config.width),
            nn.SiLU(),
        )
        self.convolutions = nn.ModuleList(
            MeanConv(config.width, config.width) for _ in range(config.depth)
        )
        self.norms = nn.ModuleList(nn.LayerNorm(config.width) for _ in range(config.depth))
        self.leave = nn.Sequential(nn.SiLU(), nn.Dropout(config.dropout))

    def encode(self, features: torch.Tensor, nodes: Nodes) -> torch.Tensor:
        """Return every node's features after all rounds."""
        h: torch.Tensor = self.enter(features)
        for convolution, norm in zip(self.convolutions, self.norms, strict=True):
            h = h + self.leave(norm(convolution(h, nodes.edges)))
        return h

    def edges_of(self, seen: Observation) -> Neighbours:
        """Return the means' weights: no list of edges."""
        return Neighbours.of(seen, self.inputs.edges)


CECI_SAGE = ZooRow(SAGEConfig(), CECISAGE, data=CONNECTED, training=COUNTS)
UNIVERSAL = ZooRow(
    SAGEConfig(reads=EVERYTHING),
    CECISAGE,
    data=WHATEVER,
    training=COUNTS,
    summary="GraphSAGE for any observation: trained on every kind of mask; reads all evidence.",
)
