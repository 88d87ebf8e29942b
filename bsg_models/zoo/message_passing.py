"""Share the trunk of graph networks: residual rounds of messages between building and rooms."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import torch
from torch import nn
from torch_geometric.data import Data
from torch_geometric.nn import GCNConv

from bsg_models.zoo.count_network import CountNetwork
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.node_features import NetworkConfig, ShownDropout


class WritesNoFile:
    """A PyG convolution that writes no code to disk; name it before PyG's class.

    PyG otherwise writes a module for each convolution class into the temporary directory, runs it,
    and leaves it there. The results are the same to the bit.
    """

    def _set_jittable_templates(self, raise_on_error: bool = False) -> None:
        """Generate nothing."""


class NormalisedConv(WritesNoFile, GCNConv):  # type: ignore[misc]
    """PyG's sum over neighbours and the node itself, by the square roots of their degrees."""


class MessagePassing(CountNetwork):
    """`depth` rounds of h ← h + dropout(SiLU(norm(convolve(h)))).

    The residual sum keeps a node's own information. Without it, rounds of averaging over a star of
    rooms make the rooms alike.
    """

    def __init__(
        self,
        config: NetworkConfig,
        inputs: ModelInputs,
        *,
        convolution: Callable[[int], nn.Module],
    ) -> None:
        super().__init__(config, inputs)
        self.edge_bytes = 4 * config.width  # what an edge carries, in single precision
        self.enter = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.told),
            nn.Linear(self.features.width, config.width),
            nn.SiLU(),
        )
        self.convolutions = nn.ModuleList(convolution(config.width) for _ in range(config.depth))
        self.norms = nn.ModuleList(nn.LayerNorm(config.width) for _ in range(config.depth))
        self.leave = nn.Sequential(nn.SiLU(), nn.Dropout(config.dropout))

    def encode(self, features: torch.Tensor, graphs: Data) -> torch.Tensor:
        """Return every node's features after all rounds."""
        h: torch.Tensor = self.enter(features)
        edges = self.edges_of(graphs)
        for convolution, norm in zip(self.convolutions, self.norms, strict=True):
            h = h + self.leave(norm(convolution(h, edges)))
        return h

    def edges_of(self, graphs: Data) -> Any:
        """Return the edges in the form that the convolutions take."""
        return graphs.edge_index
