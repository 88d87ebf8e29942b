"""A transformer over the nodes of a building: every room attends to every other."""

from __future__ import annotations

from typing import Literal

import torch
from pydantic import Field, model_validator
from torch import nn
from torch_geometric.utils import to_dense_batch

from bsg_data.observation.observation import Observation
from bsg_models.inputs.nodes import Nodes
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.count_network import CountNetwork
from bsg_models.zoo.features import EVERYTHING, NetworkConfig, ShownDropout
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import COUNTS, VARIED, WHATEVER


class RoomTransformerConfig(NetworkConfig):
    """Attention of all nodes of a building to each other; `heads` divides `width`."""

    family: Literal["room-transformer"] = "room-transformer"
    heads: int = Field(default=4, ge=1)

    @model_validator(mode="after")
    def _heads_divide(self) -> RoomTransformerConfig:
        if self.width % self.heads:
            raise ValueError(f"width {self.width} must be a multiple of heads {self.heads}")
        return self


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


ROOM_TRANSFORMER = ZooRow(RoomTransformerConfig(), RoomTransformer, data=VARIED, training=COUNTS)
UNIVERSAL_TRANSFORMER = ZooRow(
    RoomTransformerConfig(reads=EVERYTHING),
    RoomTransformer,
    data=WHATEVER,
    training=COUNTS,
    summary="Attention between rooms, for any observation: trained on every kind of mask.",
)
