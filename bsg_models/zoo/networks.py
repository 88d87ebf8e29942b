"""Networks of hidden counts: node features, a trunk, and a prior per room and class.

    k ~ softmax((Q h)_c)         one of K components of class c in a room
    Λ | k ~ Gamma(r, r / m)      its rate; log m = (W h)_kc, log r = (U h)_kc
    V ~ Poisson((1 − f) Λ)       what was seen of it
    H ~ Poisson(f Λ)             what is hidden, so that
    H | V, k ~ NB(mean f (r + V) / (r / m + 1 − f), dispersion r + V)

h is the trunk's encoding of a node's features, and f the share that the node hides. This is
shrinkage per class (`bsg_models.zoo.gamma_poisson`) with a separate prior for every room. h knows
V, so the components' weights are those after V. Two components say what one cannot: many or none.
The network predicts the usual count in such a room, and how sure that is. Bayes' rule then adds the
seen objects of the class itself, at any share. So the node's own histogram need not pass through
the trunk.

The prior of the first true counts is tilted (`bsg_models.belief.negative_binomial`) by factors that
are also linear in h: rooms have one refrigerator, not two. Common sense about the room's label
tilts the count 0 (`bsg_models.zoo.features`).
"""

from __future__ import annotations

from abc import abstractmethod
from typing import Literal

import numpy as np
import torch
from pydantic import Field, model_validator
from torch import nn
from torch_geometric.nn import SAGEConv
from torch_geometric.utils import to_dense_batch

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import MIN_RATE, CountDistribution
from bsg_models.belief.negative_binomial import (
    hidden_posterior,
    hidden_tilts,
    log_negative_binomial,
)
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.nodes import Neighbours, Nodes
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.features import (
    EVERYTHING,
    LabelPrior,
    NetworkConfig,
    NodeFeatures,
    ShownDropout,
)
from bsg_models.zoo.gamma_poisson import tally_rooms
from bsg_models.zoo.gcn import WritesNoFile
from bsg_models.zoo.model import ModelInputs, Network, to_array
from bsg_models.zoo.settings import CONNECTED, COUNTS, LONG, VARIED, WHATEVER, DataConfig

_MOST = 5.0  # limit of log m and |log r|: e^5 objects of a class in a room; log m ≥ −10

# Of the hidden counts: λ before tilts, r and the logarithm of the weight of each component, each
# `[K, N, C]`, and J tilts `[K, N, C]`.
_Posterior = tuple[torch.Tensor, torch.Tensor, torch.Tensor, list[torch.Tensor]]


class CountNetwork(CalibratedModel, Network):
    """A network that predicts the hidden counts of rooms; a building hides what its rooms hide."""

    def __init__(self, config: NetworkConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.reads = config.reads
        self.features = NodeFeatures(config, inputs.classes, len(inputs.vocabulary))
        self.head = PriorHead(config, inputs.classes)
        self.labels = LabelPrior(inputs.classes) if "labels" in self.features.reads else None

    @abstractmethod
    def encode(self, features: torch.Tensor, nodes: Nodes) -> torch.Tensor:
        """Return the trunk's encoding of features `[N, F]`: `[N, width]`."""

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Start the head from the mean histogram of the training rooms."""
        if self.labels is not None:
            self.labels.read_table(data.manifest.class_space.classes)
        tallies = tally_rooms(data, scenes_of(data, "train", fold=choice.fold))
        means = [values @ times / times.sum() for values, times in tallies]
        self.head.start(torch.tensor(means, dtype=torch.float64))

    def forward(self, nodes: Nodes) -> _Posterior:
        """Return the posterior of the hidden counts of N nodes and C classes."""
        nodes = self.features.forget(nodes)
        encoded = self.encode(self.features(nodes), nodes)
        sense = None
        if self.labels is not None:  # a room that was seen says more than its label
            sense = self.labels(nodes.evidence["labels"]) * nodes.hidden_share[:, None]
        posterior: _Posterior = self.head(encoded, nodes, sense)
        return posterior

    def loss(self, nodes: Nodes) -> torch.Tensor:
        """Return the mean of −log P(hidden) over rooms and the classes that are known there."""
        rooms = ~nodes.is_building
        mean, dispersion, log_weight, tilts = self(nodes)
        each: torch.Tensor = log_negative_binomial(
            (nodes.y - nodes.x)[rooms].clamp(min=0),
            mean[:, rooms].clamp(min=MIN_RATE),
            dispersion[:, rooms],
            [tilt[:, rooms] for tilt in tilts],
        )
        cells = torch.logsumexp(each + log_weight[:, rooms], dim=0)
        cells = torch.where(nodes.known[rooms], cells, 0.0)
        return -cells.sum() / max(self.cells_of(nodes), 1)  # a batch may have no rooms

    def cells_of(self, nodes: Nodes) -> int:
        """Return the number of known cells of rooms."""
        return int(nodes.known[~nodes.is_building].sum())

    def validation_loss(self, nodes: Nodes) -> tuple[float, int]:
        """Return the sum of the loss over rooms and classes, and the number of these cells."""
        self.eval()
        with torch.no_grad():
            cells = self.cells_of(nodes)
            return (self.loss(nodes).item() * cells if cells else 0.0), cells

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the distribution that the network gives."""
        if self.training:
            self.eval()
        with torch.no_grad():
            mean, dispersion, log_weight, tilts = self(self.nodes_of(seen))
        return CountDistribution(
            to_array(mean),
            to_array(dispersion),
            to_array(log_weight.double().softmax(dim=0)),
            np.stack([to_array(tilt) for tilt in tilts]) if tilts else None,
        )


class PriorHead(nn.Module):
    """Layers from the encoded nodes to priors of the rates, and to the hidden counts."""

    def __init__(self, config: NetworkConfig, classes: int) -> None:
        super().__init__()
        self.dropout = nn.Dropout(config.dropout)
        self.classes = classes
        self.components = config.components
        self.mean = nn.Linear(config.width, self.components * classes)
        self.shape = nn.Linear(config.width, self.components * classes)
        self.weight = nn.Linear(config.width, self.components * classes)
        layers = [self.mean, self.shape, self.weight]
        self.tilted = config.tilted
        if self.tilted:
            self.tilt = nn.Linear(config.width, self.tilted * self.components * classes)
            layers.append(self.tilt)
        for layer in layers:
            nn.init.zeros_(layer.weight)
            nn.init.zeros_(layer.bias)

    def start(self, means: torch.Tensor) -> None:
        """Start with a room's mean counts `[C]` as the prior of all."""
        with torch.no_grad():
            apart = torch.linspace(-1, 1, self.components + 2)[1:-1, None]  # none alike
            self.mean.bias.copy_((means.clamp(min=MIN_RATE).log() + apart).flatten())

    def forward(
        self, encoded: torch.Tensor, nodes: Nodes, sense: torch.Tensor | None
    ) -> _Posterior:
        """Return the posterior of the hidden counts; `sense` `[N, C]` adds to the odds of any."""
        mean = self._read(self.mean, encoded).clamp(-2 * _MOST, _MOST).exp()
        shape = self._read(self.shape, encoded).clamp(-_MOST, _MOST).exp()
        log_weight = self._read(self.weight, encoded).log_softmax(dim=0)
        hidden = hidden_posterior(shape, shape / mean, nodes.x, nodes.share)
        tilts = torch.zeros_like(mean)[None]
        if self.tilted:
            tilts = self._read(self.tilt, encoded).clamp(-_MOST, _MOST).view(-1, *mean.shape)
        elif sense is None:
            return *hidden, log_weight, []
        if sense is not None:
            tilts = torch.cat([tilts[:1] - sense, tilts[1:]])
        return *hidden, log_weight, hidden_tilts(tilts, nodes.x)

    def _read(self, layer: nn.Linear, encoded: torch.Tensor) -> torch.Tensor:
        """Return what a layer says of each component `[K, N, C]`."""
        read: torch.Tensor = layer(self.dropout(encoded))
        return read.view(len(read), -1, self.classes).transpose(0, 1)


class _SAGEConfig(NetworkConfig):
    """GraphSAGE between building and rooms."""

    family: Literal["ceci-sage"] = "ceci-sage"


class _RoomTransformerConfig(NetworkConfig):
    """Attention of all nodes of a building to each other; `heads` divides `width`."""

    family: Literal["room-transformer"] = "room-transformer"
    heads: int = Field(default=4, ge=1)

    @model_validator(mode="after")
    def _heads_divide(self) -> _RoomTransformerConfig:
        if self.width % self.heads:
            raise ValueError(f"width {self.width} must be a multiple of heads {self.heads}")
        return self


class MeanConv(WritesNoFile, SAGEConv):  # type: ignore[misc]
    """PyG's convolution, by `Neighbours` instead of a list of edges."""

    def forward(self, x: torch.Tensor, neighbours: Neighbours) -> torch.Tensor:
        """Return W₁ (mean of the neighbours) + W₂ x, `[N, width]`."""
        convolved: torch.Tensor = self.lin_l(neighbours.mean(x)) + self.lin_r(x)
        return convolved


class _CECISAGE(CountNetwork):
    """`depth` rounds of h ← h + dropout(SiLU(norm(W₁ mean of the neighbours + W₂ h))).

    The mean is that of GraphSAGE (Hamilton et al., 2017). The residual sum keeps a node's own
    information: without it, rounds of averaging over a star of rooms make the rooms alike.
    """

    def __init__(self, config: _SAGEConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        width, rounds = config.width, range(config.depth)
        self.enter = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.kept),
            nn.Linear(self.features.width, width),
            nn.SiLU(),
        )
        self.convolutions = nn.ModuleList(MeanConv(width, width) for _ in rounds)
        self.norms = nn.ModuleList(nn.LayerNorm(width) for _ in rounds)
        self.leave = nn.Sequential(nn.SiLU(), nn.Dropout(config.dropout))

    def encode(self, features: torch.Tensor, nodes: Nodes) -> torch.Tensor:
        """Return every node's features after all rounds."""
        h: torch.Tensor = self.enter(features)
        for convolution, norm in zip(self.convolutions, self.norms, strict=True):
            h = h + self.leave(norm(convolution(h, nodes.edges)))
        return h

    def edges_of(self, seen: Observation) -> Neighbours:
        """Return the means' weights: no list of edges."""
        return Neighbours.of(seen, self.inputs.edges)


class _RoomTransformer(CountNetwork):
    """Pre-norm self-attention over rooms, which have no order (Vaswani et al., 2017)."""

    def __init__(self, config: _RoomTransformerConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.enter = nn.Sequential(
            ShownDropout(config.dropout / 2, self.features.kept),
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


CECI_SAGE = ZooRow(_SAGEConfig(), _CECISAGE, data=CONNECTED, training=COUNTS)
UNIVERSAL = ZooRow(
    _SAGEConfig(reads=EVERYTHING),
    _CECISAGE,
    data=WHATEVER,
    training=LONG,
    summary="GraphSAGE for any observation: trained on every kind of mask; reads all evidence.",
)
ROOM_TRANSFORMER = ZooRow(_RoomTransformerConfig(), _RoomTransformer, data=VARIED, training=COUNTS)
UNIVERSAL_TRANSFORMER = ZooRow(
    _RoomTransformerConfig(reads=EVERYTHING),
    _RoomTransformer,
    data=WHATEVER,
    training=LONG,
    summary="Attention between rooms, for any observation: trained on every kind of mask.",
)
