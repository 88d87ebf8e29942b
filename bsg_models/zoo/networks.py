"""The networks of hidden counts: rounds of means over neighbours, and attention between rooms."""

from __future__ import annotations

from typing import Literal

import torch
from pydantic import Field, model_validator
from torch import nn
from torch_geometric.nn import SAGEConv
from torch_geometric.utils import to_dense_batch

from bsg_data.observation.observation import Observation
from bsg_models.inputs.nodes import Neighbours, Nodes
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.count_network import CountNetwork
from bsg_models.zoo.features import EVERYTHING, NetworkConfig, ShownDropout
from bsg_models.zoo.gcn import WritesNoFile
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import CONNECTED, COUNTS, VARIED, WHATEVER


class SAGEConfig(NetworkConfig):
    """GraphSAGE between building and rooms."""

    family: Literal["ceci-sage"] = "ceci-sage"


class RoomTransformerConfig(NetworkConfig):
    """Attention of all nodes of a building to each other; `heads` divides `width`."""

    family: Literal["room-transformer"] = "room-transformer"
    heads: int = Field(default=4, ge=1)

    @model_validator(mode="after")
    def _heads_divide(self) -> RoomTransformerConfig:
        if self.width % self.heads:
            raise ValueError(f"width {self.width} must be a multiple of heads {self.heads}")
        return self


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
        width, rounds = config.width, range(config.depth)
        self.enter = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.mask),
            nn.Linear(self.features.width, width),
            nn.SiLU(),
        )
        self.convolutions = nn.ModuleList(MeanConv(width, width) for _ in rounds)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in rounds)
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


class RoomTransformer(CountNetwork):
    """Pre-norm self-attention over rooms, which have no order (Vaswani et al., 2017)."""

    def __init__(self, config: RoomTransformerConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.enter = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.mask),
            nn.Linear(self.features.width, config.width),
        )
        layer = nn.TransformerEncoderLayer(
            config.width,
            config.heads,
            2 * config.width,
            config.dropout,
            activation="gelu",
            batch_first=True,
            norm_first=True,
        )
        self.layers = nn.TransformerEncoder(layer, config.depth, enable_nested_tensor=False)

    def encode(self, features: torch.Tensor, nodes: Nodes) -> torch.Tensor:
        """Return every node's features after attention within its building."""
        dense, real = to_dense_batch(self.enter(features), nodes.building)
        encoded: torch.Tensor = self.layers(dense, src_key_padding_mask=~real)[real]
        return encoded

    def edges_of(self, seen: Observation) -> None:
        """Read no edges: every room attends to every other."""


CECI_SAGE = ZooRow(SAGEConfig(), CECISAGE, data=CONNECTED, training=COUNTS)
UNIVERSAL = ZooRow(
    SAGEConfig(reads=EVERYTHING),
    CECISAGE,
    data=WHATEVER,
    training=COUNTS,
    summary="GraphSAGE for any observation: trained on every kind of mask; reads all evidence.",
)
ROOM_TRANSFORMER = ZooRow(RoomTransformerConfig(), RoomTransformer, data=VARIED, training=COUNTS)
UNIVERSAL_TRANSFORMER = ZooRow(
    RoomTransformerConfig(reads=EVERYTHING),
    RoomTransformer,
    data=WHATEVER,
    training=COUNTS,
    summary="Attention between rooms, for any observation: trained on every kind of mask.",
)
