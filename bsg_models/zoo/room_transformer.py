"""A transformer over the nodes of a building: every room attends to every other."""

from __future__ import annotations

import torch
from torch import nn
from torch_geometric.data import Data
from torch_geometric.utils import to_dense_batch

from bsg_models.zoo.count_network import CountNetwork
from bsg_models.zoo.families import RoomTransformerConfig
from bsg_models.zoo.model import building_numbers


class RoomTransformer(CountNetwork):
    """Pre-norm self-attention over rooms, which have no order (Vaswani et al., 2017)."""

    def __init__(
        self, config: RoomTransformerConfig, classes: int, vocabulary: tuple[str, ...]
    ) -> None:
        super().__init__(config, classes, vocabulary)
        self.enter = nn.Sequential(
            nn.Dropout(config.dropout / 2), nn.Linear(self.features.width, config.width)
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

    def encode(self, features: torch.Tensor, graphs: Data) -> torch.Tensor:
        """Return every node's features after attention within its building."""
        nodes, real = to_dense_batch(self.enter(features), building_numbers(graphs))
        encoded: torch.Tensor = self.layers(nodes, src_key_padding_mask=~real)[real]
        return encoded
