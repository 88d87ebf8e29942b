"""A module of torch, as the steps of a training ask it."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_models.zoo.model import State, require_same_shapes
from bsg_models.zoo.settings import DataConfig


class TorchModule(nn.Module):
    """What gradients train. A batch is what `read` returns of an observation."""

    vocabulary: tuple[str, ...]  # categories outside the classes that it reads

    @abstractmethod
    def read(self, seen: Observation, targets: Counts | None = None) -> Any:
        """Return an observation in the form that the losses take, with true counts `[N, C]`."""

    @abstractmethod
    def loss(self, batch: Any) -> torch.Tensor:
        """Return the loss that a training step lowers."""

    @abstractmethod
    def validation_loss(self, batch: Any) -> tuple[float, int]:
        """Return the sum of the loss over (node, class) cells, and their number."""

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Set what a training starts from."""

    def hold(self, **arrays: npt.ArrayLike) -> None:
        """Keep arrays of float64 as buffers; later calls replace the values."""
        for name, values in arrays.items():
            self.register_buffer(name, torch.from_numpy(np.array(values, dtype=np.float64)))

    def state(self) -> State:
        """Return copies of its parameters and buffers."""
        state = self.state_dict()
        return {name: tensor.detach().cpu().numpy().copy() for name, tensor in state.items()}

    def load_state(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take parameters and buffers, and stop training."""
        require_same_shapes(self.state(), state)
        self.load_state_dict({name: torch.from_numpy(values) for name, values in state.items()})
        self.eval()
