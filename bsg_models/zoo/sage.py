"""CECI with GraphSAGE: separate weights for a node's features and the mean of its neighbours'."""

from __future__ import annotations

from typing import Literal

import torch
from torch import nn
from torch_geometric.data import Data
from torch_geometric.nn import SAGEConv

from bsg_data.observation.observation import Observation
from bsg_models.inputs.graphs import Nodes, to_nodes
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.count_network import CountNetwork
from bsg_models.zoo.gcn import WritesNoFile
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.neighbours import ListedNeighbours, Neighbours
from bsg_models.zoo.node_features import NetworkConfig, ShownDropout
from bsg_models.zoo.training_recipes import CONNECTED, COUNTS, EVERYTHING, WHATEVER


class SAGEConfig(NetworkConfig):
    """GraphSAGE between building and rooms."""

    family: Literal["ceci-sage"] = "ceci-sage"


class MeanConv(WritesNoFile, SAGEConv):  # type: ignore[misc]
    """PyG's convolution, which also takes `Neighbours` instead of a list of edges."""

    def forward(
        self, x: torch.Tensor, edges: torch.Tensor | Neighbours | ListedNeighbours
    ) -> torch.Tensor:
        """Return W₁ (mean of the neighbours) + W₂ x, `[N, width]`."""
        if isinstance(edges, Neighbours | ListedNeighbours):
            convolved: torch.Tensor = self.lin_l(edges.mean(x)) + self.lin_r(x)
        else:
            convolved = super().forward(x, edges)
        return convolved


class CECISAGE(CountNetwork):
    """`depth` rounds of h ← h + dropout(SiLU(norm(W₁ mean of the neighbours + W₂ h))).

    The mean is that of GraphSAGE (Hamilton et al., 2017). The residual sum keeps a node's own
    information: without it, rounds of averaging over a star of rooms make the rooms alike.
    """

    def __init__(self, config: SAGEConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.enter = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.told),
            nn.Linear(self.features.width, config.width),
            nn.SiLU(),
        )
        self.convolutions = nn.ModuleList(
            MeanConv(config.width, config.width) for _ in range(config.depth)
        )
        self.norms = nn.ModuleList(nn.LayerNorm(config.width) for _ in range(config.depth))
        self.leave = nn.Sequential(nn.SiLU(), nn.Dropout(config.dropout))

    def encode(self, features: torch.Tensor, graphs: Data) -> torch.Tensor:
        """Return every node's features after all rounds."""
        h: torch.Tensor = self.enter(features)
        edges = graphs.edge_index
        if not isinstance(edges, Neighbours):
            edges = ListedNeighbours.of(edges, nodes=len(h))
        for convolution, norm in zip(self.convolutions, self.norms, strict=True):
            h = h + self.leave(norm(convolution(h, edges)))
        return h

    def nodes_of(self, seen: Observation) -> Nodes:
        """Return an observation in the form for predictions, with its neighbours."""
        return to_nodes(self.reading_of(seen), edges=Neighbours.of(seen, self.inputs.edges))


CECI_SAGE = ZooRow(SAGEConfig(), CECISAGE, data=CONNECTED, training=COUNTS)
UNIVERSAL = ZooRow(
    SAGEConfig(reads=EVERYTHING),
    CECISAGE,
    data=WHATEVER,
    training=COUNTS,
    summary="GraphSAGE for any observation: trained on every kind of mask; reads all evidence.",
)
