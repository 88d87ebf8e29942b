"""One building as a graph, written out by hand."""

from __future__ import annotations

import torch
from torch_geometric.data import Data

from bsg_models.inputs.graphs import connect


def graph(inputs: list[list[float]], *, fraction: float = 0.5, vocabulary: int = 0) -> Data:
    """Return a building of histograms `[N, C]`, all of it visited and hidden in the same share."""
    nodes = len(inputs)
    return Data(
        x=torch.tensor(inputs),
        edge_index=connect(nodes, ("up", "down")),
        adjacent_index=connect(nodes, ()),
        is_building=torch.arange(nodes) == 0,
        visited=torch.ones(nodes, dtype=torch.bool),
        fraction=torch.full((nodes,), fraction),
        others=torch.zeros(nodes, vocabulary),
    )
