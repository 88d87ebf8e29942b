"""CECI with GraphSAGE: a node's own features and the mean of its neighbours', weighed apart."""

from __future__ import annotations

from typing import Literal

from torch_geometric.nn import SAGEConv

from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.message_passing import MessagePassing
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.node_features import NetworkConfig
from bsg_models.zoo.training_recipes import CONNECTED, COUNTS, EVERYTHING, WHATEVER


class SAGEConfig(NetworkConfig):
    """GraphSAGE between building and rooms."""

    family: Literal["ceci-sage"] = "ceci-sage"


class CECISAGE(MessagePassing):
    """h ← W₁ h + W₂ mean of the neighbours (Hamilton et al., 2017)."""

    def __init__(self, config: SAGEConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs, convolution=lambda width: SAGEConv(width, width))


CECI_SAGE = ZooRow(SAGEConfig(), CECISAGE, data=CONNECTED, training=COUNTS)
UNIVERSAL = ZooRow(
    SAGEConfig(reads=EVERYTHING),
    CECISAGE,
    data=WHATEVER,
    training=COUNTS,
    summary="GraphSAGE for whatever a robot has seen: trained on every mask; reads all evidence.",
)
