"""CECI with attention: a building attends to its rooms, and rooms to their building."""

from __future__ import annotations

from typing import Literal

from pydantic import Field, model_validator
from torch_geometric.nn import GATv2Conv

from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.message_passing import MessagePassing, WritesNoFile
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.node_features import NetworkConfig
from bsg_models.zoo.training_recipes import CONNECTED, COUNTS


class GATConfig(NetworkConfig):
    """Graph attention between building and rooms; `heads` divides `width`."""

    family: Literal["ceci-gat"] = "ceci-gat"
    heads: int = Field(default=4, ge=1)

    @model_validator(mode="after")
    def _heads_divide(self) -> GATConfig:
        if self.width % self.heads:
            raise ValueError(f"width {self.width} must be a multiple of heads {self.heads}")
        return self


class AttentionConv(WritesNoFile, GATv2Conv):  # type: ignore[misc]
    """PyG's attention over neighbours."""


class CECIGAT(MessagePassing):
    """h ← Σ of the neighbours' features by attention (GATv2, Brody et al., 2022)."""

    def __init__(self, config: GATConfig, inputs: ModelInputs) -> None:
        super().__init__(
            config,
            inputs,
            convolution=lambda width: AttentionConv(
                width, width // config.heads, heads=config.heads
            ),
        )


CECI_GAT = ZooRow(GATConfig(), CECIGAT, data=CONNECTED, training=COUNTS)
