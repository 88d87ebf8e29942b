"""What the paper's idea needs to work: GCN layers that keep each room's own histogram.

The paper's layers (III-A) average over building and rooms, and a last layer predicts the whole
histogram, so that a room's own counts must pass through five rounds of averaging. Here every layer
adds to what the node holds, and the last one predicts what is hidden, never below 0, on top of what
was seen.
"""

from __future__ import annotations

from torch_geometric.nn import GCNConv

from bsg_models.zoo.families import ResidualGCNConfig
from bsg_models.zoo.message_passing import MessagePassing


class ResidualGCN(MessagePassing):
    """h ← D^-½ (A + I) D^-½ h W (Kipf and Welling, 2017), added to h."""

    def __init__(
        self, config: ResidualGCNConfig, classes: int, vocabulary: tuple[str, ...]
    ) -> None:
        super().__init__(
            config, classes, vocabulary, convolution=lambda width: GCNConv(width, width)
        )
