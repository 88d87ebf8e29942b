"""Compute the mean of every node's neighbours without a list of edges, linear in the rooms.

If every room sees every other, R rooms have R (R − 1) edges: 100 million for 10,000 rooms. Their
means need no edges. The mean over the other rooms is the sum over all rooms minus the room's own
part:

    mean of the others of i = (Σ_j h_j − h_i) / (R − 1)

`bsg_models.inputs.edges` lists the same edges for training. Sums are in double precision, so that
the difference of two large ones is as exact as a sum over the edges in single precision.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch

from bsg_data.arrays import Floats
from bsg_data.observation.observation import Observation
from bsg_models.inputs.edges import EdgeSet, edges_of


@dataclass(frozen=True, eq=False)
class Neighbours:
    """The neighbours among N nodes of B buildings, as weights of each node for three sums.

    Attributes:
        building: `[N]` number of each node's building.
        first: `[B]` row of each building's own node.
        of_rooms: `[N, 1]` weight of the sum over all rooms of the building.
        of_itself: `[N, 1]` weight of the node itself.
        of_building: `[N, 1]` weight of the building's own node.
        pairs: `[2, A]` other edges, from and to.
        of_pairs: `[A, 1]` weight of the first node of each pair for the second.
    """

    building: torch.Tensor
    first: torch.Tensor
    of_rooms: torch.Tensor
    of_itself: torch.Tensor
    of_building: torch.Tensor
    pairs: torch.Tensor
    of_pairs: torch.Tensor

    @classmethod
    def of(cls, seen: Observation, edges: Sequence[EdgeSet]) -> Neighbours:
        """Return the neighbours by some kinds of edges."""
        rooms = np.diff(seen.starts)[seen.building] - 1
        is_room = ~seen.is_building
        complete = is_room & ("complete" in edges)
        down = is_room & ("down" in edges)
        up = seen.is_building & ("up" in edges)
        pairs = np.zeros((2, 0), dtype=np.int64)
        if "adjacent" in edges and "complete" not in edges:
            pairs = edges_of(seen, ("adjacent",))
        number = np.where(complete, rooms - 1, 0) + down + np.where(up, rooms, 0)
        number += np.bincount(pairs[1], minlength=len(rooms))
        weight = 1 / np.maximum(number, 1)
        return cls(
            building=torch.from_numpy(seen.building),
            first=torch.from_numpy(seen.starts[:-1]),
            of_rooms=_column(weight * (complete | up)),
            of_itself=_column(-weight * complete),
            of_building=_column(weight * down),
            pairs=torch.from_numpy(pairs),
            of_pairs=_column(weight[pairs[1]]),
        )

    def mean(self, h: torch.Tensor) -> torch.Tensor:
        """Return the mean of every node's neighbours, `[N, W]` of `[N, W]`; 0 without neighbours.

        Edges go into a node from its neighbours, each once.
        """
        own = h.double()
        buildings = own[self.first]
        rooms = torch.zeros_like(buildings).index_add_(0, self.building, own) - buildings
        mean = self.of_rooms * rooms[self.building] + self.of_itself * own
        mean += self.of_building * buildings[self.building]
        if self.pairs.shape[1]:
            mean.index_add_(0, self.pairs[1], self.of_pairs * own[self.pairs[0]])
        return mean.to(h.dtype)


@dataclass(frozen=True, eq=False)
class ListedNeighbours:
    """The neighbours from a list of edges, as a matrix for the gradients of a training.

    A product with the matrix adds in the same order as PyG, and copies no features per edge: the
    same numbers in a third of the time.

    Attributes:
        matrix: `[N, N]` sparse; 1 for an edge into the row's node from the column's.
        number: `[N, 1]` of each node's neighbours, at least 1.
    """

    matrix: torch.Tensor
    number: torch.Tensor

    @classmethod
    def of(cls, edges: torch.Tensor, *, nodes: int) -> ListedNeighbours:
        """Return the neighbours of N nodes by directed edges `[2, E]`, each listed once."""
        ones = torch.ones(edges.shape[1], device=edges.device)
        matrix = torch.sparse_coo_tensor(
            edges.flip(0), ones, (nodes, nodes), check_invariants=False
        ).coalesce()
        number = torch.bincount(edges[1], minlength=nodes).clamp(min=1)
        return cls(matrix, number[:, None].to(ones.dtype))

    def mean(self, h: torch.Tensor) -> torch.Tensor:
        """Return the mean of every node's neighbours, `[N, W]` of `[N, W]`; 0 without any."""
        mean: torch.Tensor = torch.sparse.mm(self.matrix, h) / self.number
        return mean


def _column(values: Floats) -> torch.Tensor:
    return torch.from_numpy(values[:, None])
