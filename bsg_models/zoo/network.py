"""A network of torch: the interface of all models that are trained by gradient."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping
from typing import Any

import numpy as np
import numpy.typing as npt
import torch
from torch import nn

from bsg_data.arrays import Counts
from bsg_data.observation.observation import Observation
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import CheckpointError
from bsg_models.inputs.nodes import Nodes, list_edges, to_nodes
from bsg_models.zoo.model import BeliefModel, ModelInputs, State
from bsg_models.zoo.settings import ModelConfig

_CPU = torch.device("cpu")


class Network(BeliefModel, nn.Module):
    """A model that is trained by the gradient of its loss on nodes with their targets `y`."""

    by_gradient = True

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        nn.Module.__init__(self)
        BeliefModel.__init__(self, config, inputs)

    def hold(self, **arrays: npt.ArrayLike) -> None:
        """Keep arrays of float64 as buffers; later calls replace the values."""
        for name, values in arrays.items():
            tensor = torch.from_numpy(np.array(values, dtype=np.float64))
            if name in self._buffers:
                self.get_buffer(name).copy_(tensor)
            else:
                self.register_buffer(name, tensor)

    def state(self) -> State:
        """Return copies of its parameters and buffers."""
        state = self.state_dict()
        return {name: tensor.detach().cpu().numpy().copy() for name, tensor in state.items()}

    def load_state(self, state: Mapping[str, npt.NDArray[Any]]) -> None:
        """Take parameters and buffers, and stop training."""
        try:
            self.load_state_dict({name: torch.from_numpy(one) for name, one in state.items()})
        except RuntimeError as error:
            raise CheckpointError(str(error)) from error
        self.eval()

    def nodes_of(self, seen: Observation, targets: Counts | None = None) -> Nodes:
        """Return an observation as tensors, with the edges that the network reads."""
        return to_nodes(seen, edges=self.edges_of(seen), targets=targets).to(_CPU)

    def edges_of(self, seen: Observation) -> Any:
        """Return the edges in the form that the network reads: by default a list `[2, E]`."""
        return list_edges(seen, self.inputs.edges)

    def expect(self, seen: Observation) -> Expectation:
        """Return the prediction, without gradients, if it is finite."""
        with torch.no_grad():
            return super().expect(seen)

    @abstractmethod
    def loss(self, nodes: Nodes) -> torch.Tensor:
        """Return the loss that a training step lowers."""

    @abstractmethod
    def validation_loss(self, nodes: Nodes) -> tuple[float, int]:
        """Return the sum of the loss over (node, class) cells, and their number."""
