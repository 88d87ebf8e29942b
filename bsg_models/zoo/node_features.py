"""What a network reads of a node: its own histogram, its mask, its building, what else is there.

Every feature is of order one, whatever the size of a room or a building.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Literal

import numpy as np
import numpy.typing as npt
import torch
from pydantic import Field
from torch import nn
from torch_geometric.data import Data
from torch_geometric.utils import scatter

from bsg_models.zoo.model import building_numbers, share_of
from bsg_models.zoo.settings import ModelConfig

_EDGE = 0.02  # shares are at least this far from 0 and 1 where a logarithm is taken


Likelihood = Literal["mse", "poisson", "negative-binomial"]
Reading = Literal["mask", "building", "categories", "withheld"]


class NetworkConfig(ModelConfig):
    """What all networks of hidden counts have (`bsg_models.zoo.count_network`).

    Attributes:
        width: channels of the hidden layers.
        depth: rounds or layers.
        dropout: share of channels dropped after each; half of it of the features.
        likelihood: of the hidden counts.
        reads: what a node's features hold besides its own histogram; see `NodeFeatures`.
        embedding: width of the embedding of the categories outside the classes.
        embed: `learned` with all the rest, or `svd`: the first components of which categories are
            in which training rooms, kept as they are.
        category_dropout: share of these categories that training overlooks.
        calibrate: fit three numbers on the val buildings that mend how sure the model is.
    """

    family: str = ""  # each names its own
    width: int = Field(default=128, ge=1, le=4096)
    depth: int = Field(default=2, ge=1, le=64)
    dropout: float = Field(default=0.4, ge=0.0, lt=1.0)
    likelihood: Likelihood = "negative-binomial"
    reads: tuple[Reading, ...] = ("mask", "building", "categories")
    embedding: int = Field(default=32, ge=1, le=4096)
    embed: Literal["learned", "svd"] = "learned"
    category_dropout: float = Field(default=0.3, ge=0.0, lt=1.0)
    calibrate: bool = True


class NodeFeatures(nn.Module):
    """Turn masked graphs into features `[N, F]`.

    Always the node's own histogram: log(1 + count), presence and log(1 + total). And as the
    configuration says (`reads`):

    - `mask`: the share that the node hides, as log-odds, and whether it was visited; without them
      "nothing there" looks like "not looked".
    - `building`: log(1 + count) of the building, the share of the other visited rooms in which each
      class was seen, the logarithm of the number of rooms, and what kind of node it is.
    - `withheld`: of each class whether it is withheld, so that "none" is no news; see
      `bsg_data.observation.search_moment`.
    - `categories`: a learned embedding of the set of visible categories outside the classes, of
      the node and in the mean of the other visited rooms; single categories are dropped at random
      in training.

    Attributes:
        width: F.
    """

    def __init__(self, config: NetworkConfig, classes: int, vocabulary: int) -> None:
        super().__init__()
        self.reads = frozenset(config.reads)
        self.width = 2 * classes + 1
        if "mask" in self.reads:
            self.width += 2
        if "building" in self.reads:
            self.width += 2 * classes + 2
        if "withheld" in self.reads:
            self.width += classes
        if not vocabulary:  # none is common enough to be read
            self.reads -= {"categories"}
        if "categories" in self.reads:
            self.category_dropout = config.category_dropout
            self.embedding = nn.Linear(vocabulary, config.embedding, bias=False)
            self.svd = config.embed == "svd"
            self.embedding.requires_grad_(not self.svd)
            self.width += config.embedding * (2 if "building" in self.reads else 1)

    def fit(self, present: Sequence[npt.NDArray[np.bool_]]) -> None:
        """Take the embedding from which categories are in which rooms, each `[R, V]`, if so asked.

        The truncated singular value decomposition, each component scaled to unit variance.
        """
        if "categories" not in self.reads or not self.svd:
            return
        rooms = np.concatenate(present).astype(float)
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
            every = torch.ones(len(seen), sum(part.shape[1] for part in shown[1:]))
            parts += _look_around(
                graphs, torch.cat(shown, dim=1), torch.cat([looked_for, every], dim=1)
            )
        return torch.cat(parts, dim=1)

    def _embed(self, graphs: Data) -> torch.Tensor:
        present = (graphs.others > 0).float()
        if self.training:  # dropped, not scaled up: a robot overlooks things, too
            present = present * (torch.rand_like(present) >= self.category_dropout)
        embedded: torch.Tensor = self.embedding(present)
        return embedded


def _look_around(graphs: Data, shown: torch.Tensor, looked_for: torch.Tensor) -> list[torch.Tensor]:
    """Return what is around each node.

    Args:
        graphs: a graph or a batch.
        shown: `[N, S]` what every node shows.
        looked_for: `[N, S]` 1 where a node could show it, 0 where that is withheld.

    Returns:
        `[N, C]` the building's counts, `[N, S]` the mean of the other visited rooms that could
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
