"""Turn a node into a network's features: its histogram, its mask, its building, its surroundings.

Every feature is of order one, whatever the size of a room or a building.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Literal

import numpy as np
import numpy.typing as npt
import torch
from pydantic import Field
from torch import nn
from torch_geometric.data import Data
from torch_geometric.utils import scatter

from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import BUILDING_KINDS, KNOWN_SOURCES
from bsg_models.zoo.model import building_numbers, share_of
from bsg_models.zoo.settings import ModelConfig

_EDGE = 0.02  # shares are moved this far from 0 and 1 before a logarithm


Likelihood = Literal["mse", "poisson", "negative-binomial"]
Reading = Literal["mask", "building", "categories", "withheld", "size", "labels", "kind", "source"]
_USUAL_AREA = 12.0  # m² of a room, whose logarithm counts as 0
# Widths of the surroundings of a room, in the order of their features.
_SURROUNDINGS = {
    "size": 2,
    "labels": len(list_room_labels()),
    "kind": len(BUILDING_KINDS),
    "source": len(KNOWN_SOURCES),
}


class NetworkConfig(ModelConfig):
    """Settings of all networks of hidden counts (`bsg_models.zoo.count_network`).

    Attributes:
        width: channels of the hidden layers.
        depth: rounds or layers.
        dropout: share of channels dropped after each layer; half of it for the features.
        likelihood: of the hidden counts.
        tilted: J, the number of first counts whose prior is tilted; 0 for a plain Gamma prior.
        reads: evidence besides the node's own histogram; see `NodeFeatures`.
        embedding: width of the embedding of the categories outside the classes.
        embed: `learned` with the network, or `svd`: fixed first components of the table of
            categories by training rooms.
        category_dropout: share of these categories that training overlooks.
        forget: share of the rooms whose size and label training hides, and of the buildings whose
            kind and source it hides, so that the network never depends on them.
        calibrate: fit the calibration on the val buildings.
    """

    family: str = ""  # each family has its own name
    width: int = Field(default=128, ge=1, le=4096)
    depth: int = Field(default=2, ge=1, le=64)
    dropout: float = Field(default=0.4, ge=0.0, lt=1.0)
    likelihood: Likelihood = "negative-binomial"
    tilted: int = Field(default=2, ge=0, le=8)
    reads: tuple[Reading, ...] = ("mask", "building", "categories")
    embedding: int = Field(default=32, ge=1, le=4096)
    embed: Literal["learned", "svd"] = "learned"
    category_dropout: float = Field(default=0.3, ge=0.0, lt=1.0)
    forget: float = Field(default=0.5, ge=0.0, lt=1.0)
    calibrate: bool = True


class NodeFeatures(nn.Module):
    """Turn masked graphs into features `[N, F]`.

    The node's own histogram is always included: log(1 + count), presence and log(1 + total). The
    configuration (`reads`) adds:

    - `mask`: the share that the node hides, as log-odds, and whether it was visited; without them
      an empty node looks like one that nobody looked into.
    - `building`: log(1 + count) of the building, the share of the other visited rooms in which each
      class was seen, the logarithm of the number of rooms, and the kind of node.
    - `withheld`: whether each class is withheld, so that its absence is no evidence; see
      `bsg_data.observation.search_moment`.
    - `categories`: an embedding of the set of visible categories outside the classes, of the node
      and averaged over the other visited rooms; training drops single categories at random.
    - `size`: the logarithm of the floor area relative to a usual room, and whether it is known.
    - `labels`: the probability of each room label, all 0 if nothing is known.
    - `kind`, `source`: the kind of building and the source of its annotation, if known.

    Attributes:
        width: F.
        told: the features that describe the mask. Dropout must leave them: a dropped one would say
            that nothing is hidden.
    """

    def __init__(self, config: NetworkConfig, classes: int, vocabulary: int) -> None:
        super().__init__()
        self.reads = frozenset(config.reads)
        self.forget = config.forget
        self.width = 2 * classes + 1
        first = self.width
        if "mask" in self.reads:
            self.width += 2
        if "withheld" in self.reads:
            self.width += classes
        self.told = slice(first, self.width)
        if "building" in self.reads:
            self.width += 2 * classes + 2
        self.width += sum(_SURROUNDINGS[name] for name in _SURROUNDINGS if name in self.reads)
        if not vocabulary:  # no category is frequent enough
            self.reads -= {"categories"}
        if "categories" in self.reads:
            self.category_dropout = config.category_dropout
            self.embedding = nn.Linear(vocabulary, config.embedding, bias=False)
            self.svd = config.embed == "svd"
            self.embedding.requires_grad_(not self.svd)
            self.width += config.embedding * (2 if "building" in self.reads else 1)

    def fit(self, present: Iterable[npt.NDArray[np.bool_]]) -> None:
        """Compute the `svd` embedding, if configured, from the categories of rooms `[R, V]`.

        It is the truncated singular value decomposition, each component scaled to unit variance.
        Only this embedding needs the rooms, and holds them all in memory.
        """
        if "categories" not in self.reads or not self.svd:
            return
        rooms = np.concatenate(list(present)).astype(float)
        _, _, components = np.linalg.svd(rooms, full_matrices=False)
        weight = np.zeros(self.embedding.weight.shape)
        kept = components[: len(weight)]
        weight[: len(kept)] = kept / np.maximum((rooms @ kept.T).std(axis=0), 1e-3)[:, None]
        with torch.no_grad():
            self.embedding.weight.copy_(torch.from_numpy(weight))

    def forward(self, graphs: Data) -> torch.Tensor:
        """Return features `[N, F]`."""
        seen = (graphs.x > 0).float()
        parts = [torch.log1p(graphs.x), seen, torch.log1p(graphs.x.sum(dim=1, keepdim=True))]
        if "mask" in self.reads:
            share = graphs.hidden_share.clamp(_EDGE, 1 - _EDGE)
            parts += [torch.logit(share)[:, None] / 2, graphs.visited.float()[:, None]]
        looked_for = (share_of(graphs) < 1).float()
        if "withheld" in self.reads:
            parts.append(1 - looked_for)
        shown = [seen]
        if "categories" in self.reads:
            shown.append(self._embed(graphs))
            parts.append(shown[-1])
        if "building" in self.reads:
            every = seen.new_ones(len(seen), sum(part.shape[1] for part in shown[1:]))
            parts += _look_around(
                graphs, torch.cat(shown, dim=1), torch.cat([looked_for, every], dim=1)
            )
        parts += self._surroundings(graphs)
        return torch.cat(parts, dim=1)

    def _surroundings(self, graphs: Data) -> list[torch.Tensor]:
        """Return size, label, kind and source of every node, as far as they are read."""
        parts = []
        if "size" in self.reads:
            known = (graphs.floor_area > 0) & self._remembered(graphs.floor_area)
            size = torch.log(graphs.floor_area.clamp(min=1e-2) / _USUAL_AREA) * known
            parts += [size[:, None], known.float()[:, None]]
        if "labels" in self.reads:
            parts.append(graphs.labels * self._remembered(graphs.labels[:, 0])[:, None])
        for name, of_building in (("kind", graphs.building_kind), ("source", graphs.source)):
            if name in self.reads:
                building = building_numbers(graphs)
                kept = self._remembered(of_building[graphs.is_building])[building]
                numbers = torch.where(kept, of_building, -1)
                places = torch.arange(_SURROUNDINGS[name], device=numbers.device)
                parts.append((numbers[:, None] == places).float())
        return parts

    def _remembered(self, values: torch.Tensor) -> torch.Tensor:
        """Return which of some nodes `[M]` keep their surroundings; outside training, all."""
        if not self.training:
            return torch.ones(len(values), dtype=torch.bool, device=values.device)
        return torch.rand(len(values), device=values.device) >= self.forget

    def _embed(self, graphs: Data) -> torch.Tensor:
        present = (graphs.others > 0).float()
        if self.training:  # dropped without rescaling: a robot overlooks things, too
            present = present * (torch.rand_like(present) >= self.category_dropout)
        embedded: torch.Tensor = self.embedding(present)
        return embedded


def _look_around(graphs: Data, shown: torch.Tensor, looked_for: torch.Tensor) -> list[torch.Tensor]:
    """Return what is around each node.

    Args:
        graphs: a graph or a batch.
        shown: `[N, S]` what every node shows.
        looked_for: `[N, S]` 1 where a node could show it, 0 where it is withheld.

    Returns:
        `[N, C]` the building's counts, `[N, S]` the mean over the other visited rooms that could
        show it, `[N, 1]` the number of rooms, `[N, 1]` whether the node is a building.
    """
    building = building_numbers(graphs)
    visited = (graphs.visited & ~graphs.is_building).float()[:, None] * looked_for
    others = scatter(visited, building)[building] - visited
    siblings = scatter(shown * visited, building)[building] - shown * visited
    rooms = scatter((~graphs.is_building).float(), building)[building, None]
    first = torch.nonzero(graphs.is_building)[:, 0][building]
    return [
        torch.log1p(graphs.x[first]),
        siblings / others.clamp(min=1),
        torch.log1p(rooms),
        graphs.is_building.float()[:, None],
    ]


class ShownDropout(nn.Module):
    """Dropout of features `[N, F]` that leaves those that describe the mask."""

    def __init__(self, share: float, told: slice) -> None:
        super().__init__()
        self.share = share
        self.told = told

    def forward(self, features: torch.Tensor) -> torch.Tensor:
        """Return the features; in training, some are 0 and the others scaled up."""
        if not (self.training and self.share):
            return features
        dropped = nn.functional.dropout(features, self.share)
        dropped[:, self.told] = features[:, self.told]
        return dropped
