"""CECI with a graph isomorphism network: sums over the neighbours through dense layers."""

from __future__ import annotations

from torch import nn
from torch_geometric.nn import GINConv

from bsg_models.zoo.families import GINConfig
from bsg_models.zoo.message_passing import MessagePassing


class CECIGIN(MessagePassing):
    """h ← MLP((1 + ε) h + Σ of the neighbours) (Xu et al., 2019)."""

    def __init__(self, config: GINConfig, classes: int, vocabulary: tuple[str, ...]) -> None:
        super().__init__(config, classes, vocabulary, convolution=_convolution)


def _convolution(width: int) -> nn.Module:
    # A sum over many rooms is large; the norm before the dense layers keeps it of order one.
    layers = nn.Sequential(
        nn.LayerNorm(width), nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width)
    )
    found: nn.Module = GINConv(layers, train_eps=True)
    return found
