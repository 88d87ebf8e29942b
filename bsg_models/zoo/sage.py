"""CECI with GraphSAGE: a node's own features and the mean of its neighbours', weighed apart."""

from __future__ import annotations

from torch_geometric.nn import SAGEConv

from bsg_models.zoo.families import SAGEConfig
from bsg_models.zoo.message_passing import MessagePassing


class CECISAGE(MessagePassing):
    """h ← W₁ h + W₂ mean of the neighbours (Hamilton et al., 2017)."""

    def __init__(self, config: SAGEConfig, classes: int, vocabulary: tuple[str, ...]) -> None:
        super().__init__(
            config, classes, vocabulary, convolution=lambda width: SAGEConv(width, width)
        )
