"""CECI with a graph isomorphism network: sums over the neighbours through dense layers."""

from __future__ import annotations

from typing import Literal

from torch import nn
from torch_geometric.nn import GINConv

from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.message_passing import MessagePassing, WritesNoFile
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.node_features import NetworkConfig
from bsg_models.zoo.training_recipes import COUNTS, VARIED


class GINConfig(NetworkConfig):
    """Graph isomorphism network between building and rooms."""

    family: Literal["ceci-gin"] = "ceci-gin"


class SumConv(WritesNoFile, GINConv):  # type: ignore[misc]
    """PyG's sum over neighbours, through dense layers."""


class CECIGIN(MessagePassing):
    """h ← MLP((1 + ε) h + Σ of the neighbours) (Xu et al., 2019)."""

    def __init__(self, config: GINConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs, convolution=_convolution)


def _convolution(width: int) -> nn.Module:
    # A sum over many rooms is large; the norm before the dense layers keeps it of order one.
    layers = nn.Sequential(
        nn.LayerNorm(width), nn.Linear(width, width), nn.SiLU(), nn.Linear(width, width)
    )
    convolution: nn.Module = SumConv(layers, train_eps=True)
    return convolution


CECI_GIN = ZooRow(GINConfig(), CECIGIN, data=VARIED, training=COUNTS)
