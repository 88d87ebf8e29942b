"""The one interface of all models: `counts [N, C] → Expectation`, whatever number of rooms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_data.errors import MismatchError
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.inputs.graphs import Buildings
from bsg_models.zoo.config import DataConfig


class BeliefModel(torch.nn.Module, ABC):
    """A model of what is hidden.

    A model is either fitted by counting (`fit`), or a network that `bsg_models.training.training`
    trains by the gradient of its `loss`. All that it learns is in its state dict, so one
    checkpoint format serves all.

    Attributes:
        trainable: whether it is trained by gradient.
        vocabulary: the categories outside the classes that it reads, `[V]`: the columns of `others`
            of the graphs that it is given.
        origin: the checkpoint that it was restored from; None for one that was not.
    """

    trainable: ClassVar[bool] = False
    vocabulary: tuple[str, ...] = ()
    origin: str | None = None

    def fit(self, data: Buildings, choice: DataConfig) -> None:
        """Learn from the training buildings of a dataset, or begin where training should."""

    def loss(self, graphs: Data) -> torch.Tensor:
        """Return what a step of training lowers, for masked graphs with their targets `y`."""
        raise TypeError(f"{type(self).__name__} is fitted by counting and has no loss")

    def validation_loss(self, graphs: Data) -> tuple[float, int]:
        """Return the sum of the loss over cells (node, class), and their number."""
        raise TypeError(f"{type(self).__name__} is fitted by counting and has no loss")

    def resize_buffers(self, state: Mapping[str, torch.Tensor]) -> None:
        """Prepare for the state of a checkpoint, where the shape of a tensor follows from data."""

    def expect(self, graphs: Data) -> Expectation:
        """Return what the model predicts, without gradients, and only if all of it is finite.

        Whoever asks a trained model asks here.

        Raises:
            PredictionError: naming the checkpoint, if anything is not finite.
        """
        with torch.no_grad():
            expectation = self.predict(graphs)
        if not expectation.is_finite:
            raise PredictionError(
                f"{self.origin or type(self).__name__}: the model's answer is not finite (NaN or "
                "infinite); train it again"
            )
        return expectation

    @abstractmethod
    def predict(self, graphs: Data) -> Expectation:
        """Return the expectation of a graph, or of a batch of graphs.

        Args:
            graphs: with `x` `[N, C]`, `others` `[N, V]`, `is_building`, `visited` and `fraction`
                `[N]`, `edge_index`; `withheld` `[N, C]` if anything is, see `share_of`.
        """


def to_array(tensor: torch.Tensor) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return a tensor as a float64 array."""
    return tensor.detach().cpu().numpy().astype(np.float64)


def others_of(graphs: Data, vocabulary: int) -> torch.Tensor:
    """Return which categories of a vocabulary are visible where, `[N, V]`; none if not said.

    Raises:
        MismatchError: if the graphs were made with another vocabulary.
    """
    others: torch.Tensor | None = graphs.get("others")
    if others is None or not others.shape[1]:
        return torch.zeros(len(graphs.x), vocabulary)
    if others.shape[1] != vocabulary:
        raise MismatchError(
            f"the graphs have {others.shape[1]} categories outside the classes, the model reads "
            f"{vocabulary}; make them with vocabulary=model.vocabulary"
        )
    present: torch.Tensor = (others > 0).float()
    return present


def share_of(graphs: Data) -> torch.Tensor:
    """Return the share of its objects of each class that each node hides, `[N, C]`.

    That of the node, and 1 where a class is withheld: a search is told nothing of its artifact.
    """
    share: torch.Tensor = graphs.fraction[:, None].expand_as(graphs.x)
    withheld: torch.Tensor | None = graphs.get("withheld")
    return share if withheld is None else torch.where(withheld, torch.ones_like(share), share)


def building_numbers(graphs: Data) -> torch.Tensor:
    """Return the number of each node's building in a graph or a batch, `[N]` from 0."""
    return torch.cumsum(graphs.is_building.long(), dim=0) - 1
