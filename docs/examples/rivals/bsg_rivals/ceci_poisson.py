"""Change the loss of the paper's network: hidden counts by a Poisson law, not squared errors.

    H ~ Poisson(softplus(output))

It answers E′ × O′ + softplus(output), so what was seen is never lost.
"""

from __future__ import annotations

from typing import Literal

import torch
from torch.nn import functional
from torch_geometric.data import Data

from bsg_models.ceci.gcn import CECI, ROW, CECIConfig
from bsg_models.zoo.catalogue import ZooRow

_LEAST_RATE = 1e-6  # objects


class CECIPoissonConfig(CECIConfig):
    """The paper's network with another loss: a Poisson law of the hidden counts."""

    family: Literal["ceci-poisson"] = "ceci-poisson"  # type: ignore[assignment]


class CECIPoisson(CECI):
    """Predict the rate of the hidden counts."""

    def forward(self, graph: Data) -> torch.Tensor:
        """Return what was seen and the rate of what is hidden, `[N, C]`."""
        return torch.as_tensor(graph.x + functional.softplus(super().forward(graph)))

    def losses(self, graph: Data, predicted: torch.Tensor) -> torch.Tensor:
        """Return −log P(hidden count) of every cell, `[N, C]`; factorials are Stirling's."""
        rate = (predicted - graph.x).clamp(min=_LEAST_RATE)
        hidden = graph.y - graph.x
        return functional.poisson_nll_loss(rate, hidden, False, True, reduction="none")


CECI_POISSON = ZooRow(CECIPoissonConfig(), CECIPoisson, data=ROW.data)
