"""Train a network of hidden counts in torch, by the functions that it answers with in NumPy."""

from __future__ import annotations

import copy
from collections.abc import Sequence
from dataclasses import dataclass

import torch
from torch import nn

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import MIN_RATE
from bsg_models.belief.negative_binomial import log_counts, log_none, log_normaliser
from bsg_models.ceci.network import Network
from bsg_models.inputs.nodes import Nodes
from bsg_models.zoo.layers import NO_DROPOUT, NoDropout
from bsg_models.zoo.model import BeliefModel
from bsg_models.zoo.networks import CountNetwork, Posterior
from bsg_models.zoo.settings import DataConfig
from bsg_models.zoo.torch_module import TorchModule


def as_network(model: BeliefModel) -> Network | CountGradients | None:
    """Return a model in the form that gradients train; None for one that is fitted by counting."""
    if isinstance(model, CountNetwork):
        return CountGradients(model)
    return model if isinstance(model, Network) else None


class CountGradients(TorchModule):
    """A network of hidden counts whose weights are parameters of torch, drawn at random."""

    def __init__(self, model: CountNetwork) -> None:
        super().__init__()
        self._model, self.vocabulary = copy.copy(model), model.vocabulary
        for name, weight in model.shapes.items():
            values = torch.empty(weight.shape).uniform_(-weight.spread, weight.spread)
            self._put(name, nn.Parameter(values + weight.value, requires_grad=weight.learned))
        self.hold(
            **{name: values for name, values in model.state().items() if name not in model.shapes}
        )

    def _put(self, name: str, parameter: nn.Parameter) -> None:
        """Register a parameter by a name with dots."""
        place: nn.Module = self
        *path, leaf = name.split(".")
        for part in path:
            if part not in place._modules:
                place.add_module(part, nn.Module())
            place = place.get_submodule(part)
        place.register_parameter(leaf, parameter)

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Set what the network starts from."""
        self._model.load_state(self.state())
        self._model.fit(data, choice)
        self.load_state(self._model.state())

    def read(self, seen: Observation, targets: Counts | None = None) -> Nodes:
        """Return an observation as the tensors that the network reads."""
        return self._model.nodes_of(seen, targets).to(torch.device("cpu"))

    def forward(self, nodes: Nodes) -> Posterior:
        """Return the posterior of the hidden counts; a training drops at random."""
        drop = Dropout() if self.training else NO_DROPOUT
        return self._model.forward(dict(self.named_parameters()), nodes, drop)

    def loss(self, nodes: Nodes) -> torch.Tensor:
        """Return the mean of −log P(hidden) over rooms and the classes that are known there."""
        known, found = self._count(nodes), self(nodes)
        mean, dispersion = found.mean.clamp(min=MIN_RATE), found.dispersion
        hidden = (nodes.y - nodes.x).clamp(min=0)
        none = log_none(mean, dispersion)
        log_p = none - log_normaliser(found.tilts, mean, dispersion, none=none) + found.log_weight
        each = log_counts(log_p, hidden, nodes.hiding, mean, dispersion, found.tilts)
        cells = torch.where(known, torch.logsumexp(each, dim=0), 0.0)
        return -cells.sum() / known.sum().clamp(min=1)  # a batch may have no rooms

    def _count(self, nodes: Nodes) -> torch.Tensor:
        """Return which cells count, `[N, C]`: the known ones of rooms."""
        counts: torch.Tensor = nodes.known & ~nodes.is_building[:, None]
        return counts

    def validation_loss(self, nodes: Nodes) -> tuple[float, int]:
        """Return the sum of the loss over rooms and classes, and the number of these cells."""
        self.eval()
        with torch.no_grad():
            cells = int(self._count(nodes).sum())
            return (self.loss(nodes).item() * cells if cells else 0.0), cells


@dataclass(frozen=True)
class Dropout(NoDropout):
    """What a training drops at random."""

    def channels(
        self, values: torch.Tensor, share: float, *, spared: Sequence[slice] = ()
    ) -> torch.Tensor:
        """Return values of which a share is 0 and the others scaled up, but columns `spared`."""
        dropped = nn.functional.dropout(values, share) if share else values
        if not spared:
            return dropped
        whole = torch.zeros(values.shape[1], dtype=torch.bool, device=values.device)
        for columns in spared:
            whole[columns] = True
        return torch.where(whole, values, dropped)

    def entries(self, values: torch.Tensor, share: float) -> torch.Tensor:
        """Return values of which a share is 0: a robot overlooks things, too."""
        return values * (torch.rand_like(values) >= share)

    def rows(self, rows: torch.Tensor, share: float) -> torch.Tensor:
        """Return rows of which a share is 0."""
        shown = torch.rand(len(rows), device=rows.device) >= share
        return rows * shown[:, None]
