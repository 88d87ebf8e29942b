"""Correct the paper's model: GCN layers that keep each room's own histogram.

The paper's layers (III-A) average over building and rooms, and the last layer predicts the whole
histogram. So a room's own counts must pass through five rounds of averaging. Here every layer adds
to a node's features. The last one predicts the hidden counts, never below 0, on top of the seen
ones.
"""

from __future__ import annotations

from typing import Literal

from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.message_passing import MessagePassing, NormalisedConv
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.node_features import NetworkConfig
from bsg_models.zoo.training_recipes import COUNTS, VARIED


class ResidualGCNConfig(NetworkConfig):
    """GCNConv layers that keep the node's own histogram and predict the hidden counts."""

    family: Literal["ceci-gcn-residual"] = "ceci-gcn-residual"


class ResidualGCN(MessagePassing):
    """h ← D^-½ (A + I) D^-½ h W (Kipf and Welling, 2017), added to h."""

    def __init__(self, config: ResidualGCNConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs, convolution=lambda width: NormalisedConv(width, width))


CECI_GCN_RESIDUAL = ZooRow(ResidualGCNConfig(), ResidualGCN, data=VARIED, training=COUNTS)
