"""The one interface of all models: `counts [N, C] → Expectation`, whatever number of rooms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from typing import Any, ClassVar

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_models.expectation import Expectation
from bsg_models.graph_dataset import Buildings


class BeliefModel(torch.nn.Module, ABC):
    """A model of what is hidden.

    A model is either fitted by counting (`fit`), or a network that `bsg_models.training` trains
    through `forward`. All that it learns is in its state dict, so one checkpoint format serves all.

    Attributes:
        trainable: whether it is trained by gradient.
    """

    trainable: ClassVar[bool] = False

    def fit(self, data: Buildings, scenes: tuple[str, ...]) -> None:
        """Learn from the complete histograms of the training buildings."""

    @abstractmethod
    def predict(self, graphs: Data) -> Expectation:
        """Return the expectation of a graph, or of a batch of graphs.

        Args:
            graphs: with `x` `[N, C]`, `is_building`, `visited` and `fraction` `[N]`, `edge_index`.
        """


def to_array(tensor: torch.Tensor) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return a tensor as a float64 array."""
    return tensor.detach().cpu().numpy().astype(np.float64)
