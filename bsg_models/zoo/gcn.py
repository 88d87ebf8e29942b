"""The paper's CECI model: graph convolutions over building and rooms (paper, section III-A).

"The proposed architecture consists of 5 GCN convolutional layers, followed by batch normalization,
ReLU and dropout." Input and output are histograms E × O of the nodes of interest, `[N, C]`.
"""

from __future__ import annotations

from itertools import pairwise

import torch
from torch import nn
from torch_geometric.data import Data
from torch_geometric.nn import GCNConv

from bsg_models.belief.expectation import Expectation, from_totals
from bsg_models.zoo.families import GCNConfig
from bsg_models.zoo.model import BeliefModel, to_array


class CECIGCN(BeliefModel):
    """Predict the whole histogram of every node of interest from the histograms that were seen."""

    trainable = True

    def __init__(self, config: GCNConfig, classes: int) -> None:
        super().__init__()
        widths = [classes, *[config.width] * (config.depth - 1), classes]
        self.convolutions = nn.ModuleList(
            GCNConv(before, after) for before, after in pairwise(widths)
        )
        blocks = config.depth if config.last_layer == "block" else config.depth - 1
        self.blocks = nn.ModuleList(
            nn.Sequential(nn.BatchNorm1d(width), nn.ReLU(), nn.Dropout(config.dropout))
            for width in widths[1 : blocks + 1]
        )

    def forward(self, graphs: Data) -> torch.Tensor:
        """Return predicted totals E″ × O″, `[N, C]`; a linear last layer may go below 0."""
        x: torch.Tensor = graphs.x
        for layer, convolution in enumerate(self.convolutions):
            x = convolution(x, graphs.edge_index)
            if layer < len(self.blocks):
                x = self.blocks[layer](x)
        return x

    def loss(self, graphs: Data) -> torch.Tensor:
        """Return the mean squared error of the totals over nodes and classes (section IV-A)."""
        return torch.nn.functional.mse_loss(self(graphs), graphs.y)

    def validation_loss(self, graphs: Data) -> tuple[float, int]:
        """Return the squared error of the totals, not below 0, and the number of cells."""
        totals = self.predict(graphs).totals
        return float(((totals - graphs.y.numpy()) ** 2).sum()), totals.size

    def predict(self, graphs: Data) -> Expectation:
        """Return the totals, not below 0, and what they leave hidden."""
        self.eval()
        with torch.no_grad():
            totals = self(graphs).clamp(min=0)
        return from_totals(to_array(graphs.x), to_array(totals))
