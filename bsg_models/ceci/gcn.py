"""The architecture of CECI (section III-A).

"The proposed architecture consists of 5 GCN convolutional layers, followed by batch normalization,
ReLU and dropout. The input to the network is a given graph 𝒢′ with a set of histograms
E′(C) × O′ as node attribute and the output is the predicted set of histograms E″(C) × O″, both
with size q × n". docs/models.md says what that leaves open, and how the defaults were chosen.
"""

from __future__ import annotations

from itertools import pairwise
from typing import Literal

import torch
from pydantic import Field
from torch import nn
from torch_geometric.data import Data
from torch_geometric.nn import GCNConv
from torch_geometric.nn.conv.gcn_conv import gcn_norm

from bsg_models.ceci.network import Network
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.settings import DataConfig, ModelConfig


class CECIConfig(ModelConfig):
    """The paper's CECI: five graph convolutions with batch normalisation, ReLU and dropout."""

    family: Literal["ceci"] = "ceci"
    depth: int = Field(default=5, ge=1, le=64)  # graph convolutions; the paper has 5
    # channels of the hidden layers; the paper does not state it
    width: int = Field(default=256, ge=1, le=4096)
    # share of the channels that a block drops; the paper does not state it
    dropout: float = Field(default=0.1, ge=0.0, lt=1.0)
    # whether a node hears itself twice, A + 2I, as PyG's `improved` GCN, or once, A + I
    improved: bool = True
    # what follows the last convolution: nothing (`linear`), or the same as the others (`block`),
    # which is the paper's sentence read literally
    last_layer: Literal["linear", "block"] = "linear"


class BatchNorm1d(nn.BatchNorm1d):
    """Batch normalisation; a lone node has no variance, and takes that of the batches before it."""

    def forward(self, x: torch.Tensor) -> torch.Tensor:
        """Return `[N, C]` normalised by channel."""
        if len(x) > 1:
            return super().forward(x)
        before = self.running_mean, self.running_var
        return nn.functional.batch_norm(x, *before, self.weight, self.bias, eps=self.eps)


class CECI(Network):
    """Predict the whole histogram of every node of interest from the histograms that were seen.

    A layer is Kipf and Welling's (2017): X ← D^-½ (A + I) D^-½ X W + b, or with A + 2I.
    """

    config: CECIConfig

    def __init__(self, config: CECIConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        widths = [inputs.classes, *[config.width] * (config.depth - 1), inputs.classes]
        self.convolutions = nn.ModuleList(
            GCNConv(before, after, normalize=False) for before, after in pairwise(widths)
        )
        self.blocks = nn.ModuleList(
            nn.Sequential(BatchNorm1d(width), nn.ReLU(), nn.Dropout(config.dropout))
            for width in widths[1:]
        )
        if config.last_layer == "linear":
            self.blocks[-1] = nn.Identity()

    def forward(self, graph: Data) -> torch.Tensor:
        """Return E″ × O″, `[N, C]`."""
        # All layers have the same edges, so their weights are computed once.
        x, ones = graph.x, graph.x.new_ones(graph.num_edges)  # without, `improved` does nothing
        edges, weights = gcn_norm(graph.edge_index, ones, len(x), self.config.improved)
        for convolution, block in zip(self.convolutions, self.blocks, strict=True):
            x = block(convolution(x, edges, weights))
        return torch.as_tensor(x)


ROW = ZooRow(CECIConfig(), CECI, data=DataConfig(masks="fixed", edges=("up",)))
