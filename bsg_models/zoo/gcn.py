"""Implement the paper's CECI model: graph convolutions over building and rooms (section III-A).

"The proposed architecture consists of 5 GCN convolutional layers, followed by batch normalization,
ReLU and dropout." Input and output are histograms E × O of the nodes of interest, `[N, C]`.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from typing import Literal

import numpy as np
import torch
from pydantic import Field
from torch import nn
from torch.nn import functional
from torch_geometric.nn import GCNConv

from bsg_data.arrays import Floats, Ints
from bsg_data.observation.observation import Observation
from bsg_models.arrays import Array
from bsg_models.belief.expectation import Expectation, from_totals
from bsg_models.inputs.nodes import Arrays, Nodes, list_edges
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.network import Network
from bsg_models.zoo.settings import ModelConfig

_LEAST_RATE = 1e-6  # objects, of a Poisson law


class _GCNConfig(ModelConfig):
    """The paper's CECI: GCNConv layers with batch normalisation, ReLU and dropout."""

    family: Literal["ceci-gcn"] = "ceci-gcn"
    depth: int = Field(default=5, ge=1, le=64)  # GCNConv layers; the paper has 5
    # channels of the hidden layers; the paper does not state it
    width: int = Field(default=64, ge=1, le=4096)
    # share of channels dropped after each hidden layer; the paper does not state it
    dropout: float = Field(default=0.5, ge=0.0, lt=1.0)
    # what follows the last GCNConv: nothing (`linear`), or the same as after the others (`block`),
    # which is the paper's sentence read literally
    last_layer: Literal["linear", "block"] = "linear"
    # mean squared error of whole histograms, as in the paper; or the Poisson law of hidden counts
    likelihood: Literal["mse", "poisson"] = "mse"


class _NormalisedConv(GCNConv):  # type: ignore[misc]
    """PyG's sum over neighbours and the node itself, by the square roots of their degrees.

    PyG otherwise writes a module for each convolution class into the temporary directory, runs it,
    and leaves it there. The results are the same to the bit.
    """

    def _set_jittable_templates(self, raise_on_error: bool = False) -> None:
        """Generate nothing."""


@dataclass(frozen=True, eq=False, slots=True)
class _NormalisedEdges(Arrays):
    """The edges, and one of every node to itself, with their entries of D^-½ (A + I) D^-½.

    They are computed once; otherwise every layer would compute its own.
    """

    pairs: Array  # [2, E + N] from and to
    weights: Array  # [E + N]

    @classmethod
    def of(cls, pairs: Ints, nodes: int) -> _NormalisedEdges:
        """Return those of pairs `[2, E]` of N nodes."""
        every = np.concatenate([pairs, np.tile(np.arange(nodes), (2, 1))], axis=1)
        scale = np.bincount(every[1], minlength=nodes).astype(np.float32) ** -0.5
        return cls(every, scale[every[0]] * scale[every[1]])


class _CECIGCN(Network):
    """Predict the whole histogram of every node of interest from the seen histograms."""

    config: _GCNConfig

    def __init__(self, config: _GCNConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        hidden = [config.width] * (config.depth - 1)
        widths = [inputs.classes, *hidden, inputs.classes]
        self.convolutions = nn.ModuleList(
            _NormalisedConv(before, after, normalize=False) for before, after in pairwise(widths)
        )
        blocks = config.depth if config.last_layer == "block" else config.depth - 1
        self.blocks = nn.ModuleList(
            nn.Sequential(nn.BatchNorm1d(width), nn.ReLU(), nn.Dropout(config.dropout))
            for width in widths[1 : blocks + 1]
        )

    def edges_of(self, seen: Observation) -> _NormalisedEdges:
        """Return the edges with their weights."""
        return _NormalisedEdges.of(list_edges(seen, self.inputs.edges), len(seen.inputs))

    def forward(self, nodes: Nodes) -> torch.Tensor:
        """Return predicted totals E″ × O″, `[N, C]`; with `mse`, a linear layer may go below 0."""
        outputs = self._convolve(nodes)
        return outputs if self._is_squared else nodes.x + functional.softplus(outputs)

    @property
    def _is_squared(self) -> bool:
        return self.config.likelihood == "mse"

    def _convolve(self, nodes: Nodes) -> torch.Tensor:
        """Return the outputs of the layers: totals, or what is the softplus of hidden counts."""
        x: torch.Tensor = nodes.x
        for layer, convolution in enumerate(self.convolutions):
            x = convolution(x, nodes.edges.pairs, nodes.edges.weights)
            if layer < len(self.blocks):
                x = self.blocks[layer](x)
        return x

    def loss(self, nodes: Nodes) -> torch.Tensor:
        """Return the mean loss over nodes and classes: by `mse` as in section IV-A."""
        losses = torch.where(nodes.known, self._losses(nodes, self._convolve(nodes)), 0.0)
        mean: torch.Tensor = losses.sum() / nodes.known.sum().clamp(min=1)
        return mean

    def _losses(self, nodes: Nodes, outputs: torch.Tensor) -> torch.Tensor:
        """Return the loss of each cell `[N, C]`."""
        if self._is_squared:
            errors: torch.Tensor = outputs - nodes.y
            return errors * errors
        losses: torch.Tensor = functional.poisson_nll_loss(
            functional.softplus(outputs).clamp(min=_LEAST_RATE),
            nodes.y - nodes.x,
            log_input=False,
            full=True,
            reduction="none",
        )
        return losses

    def validation_loss(self, nodes: Nodes) -> tuple[float, int]:
        """Return the sum of the losses, of totals clipped at 0, and the number of cells."""
        self.eval()
        with torch.no_grad():
            outputs = self._convolve(nodes).double()
            losses = self._losses(nodes, outputs.clamp(min=0) if self._is_squared else outputs)
        known = losses[nodes.known].numpy()
        return float(known.sum()), known.size

    def predict(self, seen: Observation) -> Expectation:
        """Return the totals, clipped at 0, and the hidden counts that follow."""
        totals = self._predict_totals(self.nodes_of(seen))
        return from_totals(seen.inputs.astype(np.float64), totals)

    def _predict_totals(self, nodes: Nodes) -> Floats:
        self.eval()
        with torch.no_grad():
            totals: Floats = self(nodes).clamp(min=0).double().numpy()
        return totals


CECI_GCN = ZooRow(_GCNConfig(), _CECIGCN)
