"""CECI with GraphSAGE: separate weights for a node's features and the mean of its neighbours'."""

from __future__ import annotations

from typing import Literal

import torch
from torch_geometric.data import Data
from torch_geometric.nn import SAGEConv

from bsg_data.observation.observation import Observation
from bsg_models.inputs.graphs import Nodes, to_nodes
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.message_passing import MessagePassing, WritesNoFile
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.neighbours import ListedNeighbours, Neighbours
from bsg_models.zoo.node_features import NetworkConfig
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


class CECISAGE(MessagePassing):
    """h ← W₁ h + W₂ mean of the neighbours (Hamilton et al., 2017).

    Training uses lists of edges, prediction uses `Neighbours`. The results agree to single
    precision, and prediction takes time linear in the rooms.
    """

    def __init__(self, config: SAGEConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs, convolution=lambda width: MeanConv(width, width))
        self.edge_bytes = 0  # predictions use `Neighbours`

    def edges_of(self, graphs: Data) -> Neighbours | ListedNeighbours:
        """Return the neighbours for all rounds."""
        edges = graphs.edge_index
        if isinstance(edges, Neighbours):
            return edges
        return ListedNeighbours.of(edges, nodes=len(graphs.x))

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
