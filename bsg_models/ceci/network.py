"""A network over the nodes of interest: its loss, and the expectation that it predicts.

The expectation of a class c given the observations B is P(c | B), and D = (P(c₁ | B) … P(c_n | B))
(equation 1); with the numbers of objects as attributes it is P(c | B, A_B), and P(a_c | B, A_B) for
the number of c itself (equations 2 and 3). "We look to find a reasonably approximate set of
probabilities E for D from the histograms": of every node, a network predicts E″ × O″.

A network is a module of torch on PyG's `Data`; it says what its layers are, and how a graph passes
through them. All else is here: its loss is the mean squared error (section IV-A), and what exceeds
the input is hidden, to become blind nodes (section III-C).
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Any

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_data.arrays import Counts
from bsg_data.observation.observation import Observation
from bsg_models.belief.expectation import Expectation, from_totals
from bsg_models.ceci.masked_graphs import to_graph
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.settings import ModelConfig
from bsg_models.zoo.torch_module import TorchModule


class Network(TorchModule, BeliefModel):
    """A model that gradients train; a subclass defines its layers and `forward`."""

    by_gradient = True

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        TorchModule.__init__(self)
        BeliefModel.__init__(self, config, inputs)

    @abstractmethod
    def forward(self, graph: Data) -> torch.Tensor:
        """Return the predicted histograms E″ × O″ of all nodes, `[N, C]`; they may be below 0."""

    def read(self, seen: Observation, targets: Counts | None = None) -> Any:
        """Return an observation in the form that the loss takes, with true counts `[N, C]`."""
        return to_graph(seen, edges=self.inputs.edges, targets=targets)

    def losses(self, graph: Data, predicted: torch.Tensor) -> torch.Tensor:
        """Return the loss of every cell, `[N, C]`: (E″ × O″ − E × O)²."""
        return torch.square(predicted - graph.y)

    def loss(self, graph: Any) -> torch.Tensor:
        """Return the mean of the losses that a training step lowers: MSE in section IV-A."""
        known = graph.y >= 0
        losses = torch.where(known, self.losses(graph, self(graph)), 0.0)
        return torch.divide(losses.sum(), known.sum().clamp(min=1))

    def validation_loss(self, graph: Any) -> tuple[float, int]:
        """Return the sum of the losses as answers count, in double precision, and their number."""
        self.eval()
        with torch.no_grad():
            losses = self.losses(graph, self._answer(graph))[graph.y >= 0]
        return float(losses.sum()), losses.numel()

    def _answer(self, graph: Data) -> torch.Tensor:
        """Return the predicted histograms, of which none is below 0."""
        return torch.clamp(self(graph).double(), min=0)

    def predict(self, seen: Observation) -> Expectation:
        """Return the expectation: hidden are max(E″ × O″ − E′ × O′, 0) objects of each class."""
        self.eval()
        with torch.no_grad():
            totals = self._answer(self.read(seen)).numpy()
        return from_totals(seen.inputs.astype(np.float64), totals)
