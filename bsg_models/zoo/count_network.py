"""Networks of hidden counts: features of the nodes, a trunk, and a prior for every room and class.

    Λ ~ Gamma(r, r / m)          the rate of class c in a room; log m = (W h)_c, log r = (U h)_c
    V ~ Poisson((1 − f) Λ)       what was seen of it
    H ~ Poisson(f Λ)             what is hidden, so that
    H | V ~ NB(mean f (r + V) / (r / m + 1 − f), dispersion r + V)

h is what the trunk makes of the features of a node, f the share that it hides. This is shrinkage
per class (`bsg_models.zoo.gamma_poisson`) with a prior of its own for every room: the network says
what is usual in such a room and how sure that is, and Bayes' rule adds what was seen of the class
itself, at any share. A node's own histogram therefore never has to survive the trunk.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import torch
from torch import nn
from torch.nn import functional
from torch_geometric.data import Data

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import place_others
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import (
    MIN_RATE,
    CountDistribution,
    negative_binomial,
    poisson,
)
from bsg_models.belief.negative_binomial import hidden_posterior
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.model import ModelInputs, Network, share_of, to_array
from bsg_models.zoo.node_features import Likelihood, NetworkConfig, NodeFeatures
from bsg_models.zoo.settings import DataConfig

_MOST = 5.0  # of log m and |log r|: e^5 objects of one class in one room; log m ≥ −10


class CountNetwork(CalibratedModel, Network):
    """A network that predicts the hidden counts of rooms; a building hides what its rooms hide."""

    def __init__(self, config: NetworkConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.likelihood: Likelihood = config.likelihood
        self.features = NodeFeatures(config, inputs.classes, len(inputs.vocabulary))
        self.head = PriorHead(config, inputs.classes)

    @abstractmethod
    def encode(self, features: torch.Tensor, graphs: Data) -> torch.Tensor:
        """Return what the trunk makes of features `[N, F]`: `[N, width]`."""

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Let the head start from the mean histogram of the training rooms."""
        scenes = scenes_of(data, "train", fold=choice.fold)
        others = [data.others(scene) for scene in scenes]
        self.features.fit(
            [place_others(one.cells, one.categories, self.vocabulary)[1:] > 0 for one in others]
        )
        rooms = np.concatenate([data.cells(scene)[1:] for scene in scenes])
        self.head.start(torch.from_numpy(rooms.mean(axis=0)))

    def forward(self, graphs: Data) -> tuple[torch.Tensor, torch.Tensor]:
        """Return means λ and dispersions r of the hidden counts, both `[N, C]`."""
        encoded = self.encode(self.features(graphs), graphs)
        posterior: tuple[torch.Tensor, torch.Tensor] = self.head(encoded, graphs)
        return posterior

    def loss(self, graphs: Data) -> torch.Tensor:
        """Return the mean loss over rooms and classes, as `likelihood` says."""
        mean, dispersion = (part[~graphs.is_building] for part in self(graphs))
        hidden = (graphs.y - graphs.x)[~graphs.is_building]
        cells = cell_loss(hidden, mean, dispersion, likelihood=self.likelihood)
        return cells.sum() / max(cells.numel(), 1)  # a batch may have no rooms

    def validation_loss(self, graphs: Data) -> tuple[float, int]:
        """Return the sum of the loss over rooms and classes, and the number of these cells."""
        self.eval()
        with torch.no_grad():
            cells = (~graphs.is_building).sum().item() * graphs.x.shape[1]
            return (self.loss(graphs).item() * cells if cells else 0.0), cells

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the distribution that the network gives."""
        self.eval()
        with torch.no_grad():
            mean, dispersion = (to_array(part) for part in self(self.graph_of(seen)))
        if self.likelihood == "negative-binomial":
            return negative_binomial(mean, dispersion)
        return poisson(mean)


class PriorHead(nn.Module):
    """From the encoded nodes to priors of the rates, and from these to the hidden counts."""

    def __init__(self, config: NetworkConfig, classes: int) -> None:
        super().__init__()
        self.dropout = nn.Dropout(config.dropout)
        self.mean = nn.Linear(config.width, classes)
        self.shape = nn.Linear(config.width, classes)
        for layer in (self.mean, self.shape):
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)

    def start(self, means: torch.Tensor) -> None:
        """Begin with the mean counts `[C]` of a room as the prior of all."""
        with torch.no_grad():
            self.mean.bias.copy_(means.clamp(min=MIN_RATE).log())

    def forward(self, encoded: torch.Tensor, graphs: Data) -> tuple[torch.Tensor, torch.Tensor]:
        """Return mean and dispersion of the posterior of the hidden counts, both `[N, C]`."""
        mean = self.mean(self.dropout(encoded)).clamp(-2 * _MOST, _MOST).exp()
        shape = self.shape(self.dropout(encoded)).clamp(-_MOST, _MOST).exp()
        return hidden_posterior(shape, shape / mean, graphs.x, share_of(graphs))


def cell_loss(
    hidden: torch.Tensor, mean: torch.Tensor, dispersion: torch.Tensor, *, likelihood: Likelihood
) -> torch.Tensor:
    """Return the loss of every (node, class), `[N, C]`.

    Args:
        hidden: `[N, C]` true counts.
        mean: `[N, C]`.
        dispersion: `[N, C]`; only `negative-binomial` reads it.
        likelihood: `mse` squares the error; the others are −log P(hidden).
    """
    if likelihood == "mse":
        return functional.mse_loss(mean, hidden, reduction="none")
    mean = mean.clamp(min=MIN_RATE)
    if likelihood == "poisson":
        return mean - hidden * mean.log() + torch.lgamma(hidden + 1)
    distribution = (
        torch.lgamma(hidden + dispersion)
        - torch.lgamma(dispersion)
        - torch.lgamma(hidden + 1)
        - dispersion * torch.log1p(mean / dispersion)
        + hidden * (mean.log() - (mean + dispersion).log())
    )
    return -distribution
