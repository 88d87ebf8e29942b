"""CECI with attention: a building attends to its rooms, and rooms to their building."""

from __future__ import annotations

from torch_geometric.nn import GATv2Conv

from bsg_models.zoo.families import GATConfig
from bsg_models.zoo.message_passing import MessagePassing


class CECIGAT(MessagePassing):
    """h ← Σ of the neighbours' features by attention (GATv2, Brody et al., 2022)."""

    def __init__(self, config: GATConfig, classes: int, vocabulary: tuple[str, ...]) -> None:
        super().__init__(
            config,
            classes,
            vocabulary,
            convolution=lambda width: GATv2Conv(width, width // config.heads, heads=config.heads),
        )
