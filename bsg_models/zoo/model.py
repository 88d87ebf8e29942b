"""The interface of all models: an observation in, an expectation out, for any rooms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Collection, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from typing import Any, TypeVar

import numpy as np
import torch

from bsg_data.arrays import Counts, Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import MismatchError
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.inputs.edges import EdgeSet, list_edges
from bsg_models.inputs.nodes import Nodes, to_nodes
from bsg_models.zoo.settings import DataConfig, ModelConfig

_Belief = TypeVar("_Belief", Expectation, CountDistribution)


@dataclass(frozen=True, slots=True)
class ModelInputs:
    """What a model can read."""

    classes: int  # C, of the histograms
    vocabulary: tuple[str, ...] = ()  # [V] categories outside the classes
    edges: tuple[EdgeSet, ...] = ("up", "down")


class BeliefModel(torch.nn.Module, ABC):
    """A model of what is hidden.

    A model is fitted by counting (`fit`), or it is a `Network`, trained by gradient. Everything
    that it learns is in its state dict, so one checkpoint format serves all models.

    Attributes:
        config: its settings.
        inputs: what it can read.
        origin: the checkpoint that it was restored from; None if it was not restored.
        notes: remarks on its fit for the user, e.g. that it read a sample.
    """

    origin: str | None = None
    notes: tuple[str, ...] = ()

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        super().__init__()
        self.config = config
        self.inputs = inputs

    @property
    def vocabulary(self) -> tuple[str, ...]:
        """Categories outside the classes that it reads, `[V]`; its observations need the same."""
        return self.inputs.vocabulary

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Learn from the training buildings of a dataset, or set the start of a training."""

    def resize_buffers(self, state: Mapping[str, torch.Tensor]) -> None:
        """Prepare for the state of a checkpoint, if the shape of a tensor depends on data."""

    def hold(self, **arrays: Floats | float) -> None:
        """Keep arrays as float64 tensors of the state dict; later calls replace the values."""
        for name, values in arrays.items():
            tensor = torch.tensor(values, dtype=torch.float64)
            if name in self._buffers:
                self.get_buffer(name).copy_(tensor)
            else:
                self.register_buffer(name, tensor)

    def expect(self, seen: Observation) -> Expectation:
        """Return the prediction, without gradients, after checking that it is finite.

        A model that does not read the hidden share may expect hidden objects in a searched room;
        `Predictor` sets those to 0.

        Raises:
            PredictionError: naming the checkpoint, if anything is not finite.
        """
        return self._require_finite(lambda: self.predict(seen))

    @abstractmethod
    def predict(self, seen: Observation) -> Expectation:
        """Return the expectation of every node of an observation, of one building or many."""

    def expect_rooms(
        self, seen: Observation, rows: Ints, columns: Ints | None = None
    ) -> CountDistribution:
        """Return the hidden counts of some rooms and classes, as `expect` does, but faster.

        Args:
            seen: what was seen.
            rows: `[M]` nodes that are rooms.
            columns: `[M, A]` classes; None for all.

        Raises:
            PredictionError: naming the checkpoint, if anything is not finite.
        """
        return self._require_finite(lambda: self.predict_rooms(seen, rows, columns))

    def predict_rooms(
        self, seen: Observation, rows: Ints, columns: Ints | None
    ) -> CountDistribution:
        """Return the hidden counts of some rooms; arguments as for `expect_rooms`."""
        return take_cells(self.predict(seen).hidden_counts, rows, columns)

    def _require_finite(self, ask: Callable[[], _Belief]) -> _Belief:
        with torch.no_grad(), one_thread():
            belief = ask()
        if not belief.is_finite:
            raise PredictionError(
                f"{self.origin or type(self).__name__}: the model's answer is not finite (NaN or "
                "infinite); train it again"
            )
        return belief


class Network(BeliefModel):
    """A model that is trained by the gradient of its loss on nodes with their targets `y`."""

    reads: Collection[str] = ()  # evidence besides the seen objects

    def nodes_of(self, seen: Observation, targets: Counts | None = None) -> Nodes:
        """Return an observation in the form that the network reads, with its own edges."""
        if seen.vocabulary != self.vocabulary:
            others = self._others_of(seen)
            seen = replace(seen, vocabulary=self.vocabulary, others=others)
        edges = self.edges_of(seen)
        return to_nodes(seen, edges=edges, targets=targets, reads=self.reads)

    def _others_of(self, seen: Observation) -> Counts:
        """Return no categories for an observation that has none, `[N, V]`."""
        if seen.vocabulary:
            raise MismatchError(
                f"the observation has {len(seen.vocabulary)} categories outside the classes, "
                f"expected the {len(self.vocabulary)} that the model reads; make it with "
                "vocabulary=model.vocabulary"
            )
        return np.zeros((len(seen.inputs), len(self.vocabulary)), dtype=np.int64)

    def edges_of(self, seen: Observation) -> Any:
        """Return the edges in the form that the network reads: by default a list `[2, E]`."""
        return torch.from_numpy(list_edges(seen, self.inputs.edges))

    @abstractmethod
    def loss(self, nodes: Nodes) -> torch.Tensor:
        """Return the loss that a training step lowers."""

    def cells_of(self, nodes: Nodes) -> int:
        """Return the number of (node, class) cells that `loss` averages over.

        Several processes that train together weight their losses by it.
        """
        return int(nodes.y.numel())

    @abstractmethod
    def validation_loss(self, nodes: Nodes) -> tuple[float, int]:
        """Return the sum of the loss over (node, class) cells, and their number."""


def take_cells(
    distribution: CountDistribution, rows: Ints, columns: Ints | None
) -> CountDistribution:
    """Return the distribution of some nodes `[M]` and classes `[M, A]`, None for all."""
    taken = distribution.take(rows)
    return taken if columns is None else taken.take_classes(columns)


def to_array(tensor: torch.Tensor) -> Floats:
    """Return a tensor as a float64 array."""
    array: Floats = tensor.detach().cpu().numpy().astype(np.float64)
    return array


@contextmanager
def one_thread() -> Iterator[None]:
    """Let torch compute on one thread, so that sums do not depend on the number of cores.

    These networks are too small to gain from more threads. They become far slower if other programs
    use the same cores, as on a robot, because each thread waits for the slowest.
    """
    threads = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        yield
    finally:
        torch.set_num_threads(threads)
