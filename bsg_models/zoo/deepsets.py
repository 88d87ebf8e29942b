"""DeepSets: encode a room from its own features and sums over its building."""

from __future__ import annotations

from typing import Literal

import torch
from torch import nn
from torch_geometric.data import Data

from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.count_network import CountNetwork
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.node_features import NetworkConfig, ShownDropout
from bsg_models.zoo.training_recipes import COUNTS, VARIED


class DeepSetsConfig(NetworkConfig):
    """Dense layers over a room's features and sums over its building."""

    family: Literal["deepsets"] = "deepsets"


class DeepSets(CountNetwork):
    """Dense layers over node features, which include sums over the rooms (Zaheer et al., 2017)."""

    def __init__(self, config: DeepSetsConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        widths = [self.features.width, *[config.width] * config.depth]
        self.layers = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.told),
            *(
                nn.Sequential(
                    nn.Linear(before, config.width),
                    nn.LayerNorm(config.width),
                    nn.SiLU(),
                    nn.Dropout(config.dropout),
                )
                for before in widths[:-1]
            ),
        )

    def encode(self, features: torch.Tensor, graphs: Data) -> torch.Tensor:
        """Return every node's features through the layers."""
        encoded: torch.Tensor = self.layers(features)
        return encoded


DEEPSETS = ZooRow(DeepSetsConfig(), DeepSets, data=VARIED, training=COUNTS)
