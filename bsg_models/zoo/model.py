"""Define the interface of all models: an observation in, an expectation out, for any rooms."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import torch
from torch_geometric.data import Data

from bsg_data.arrays import Counts, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import MismatchError
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.inputs.edges import EdgeSet
from bsg_models.inputs.graphs import Nodes, to_graph
from bsg_models.zoo.settings import DataConfig, ModelConfig
from bsg_models.zoo.threads import one_thread


@dataclass(frozen=True, slots=True)
class ModelInputs:
    """What a model can read.

    Attributes:
        classes: C, of the histograms.
        vocabulary: `[V]` categories outside the classes that it reads.
        edges: of the graphs, for a model that reads edges.
    """

    classes: int
    vocabulary: tuple[str, ...] = ()
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

    def expect(self, seen: Observation) -> Expectation:
        """Return the prediction, without gradients, after checking that it is finite.

        A model that does not read the hidden share may expect hidden objects in a searched room;
        `Predictor` sets those to 0.

        Raises:
            PredictionError: naming the checkpoint, if anything is not finite.
        """
        with torch.no_grad(), one_thread():
            expectation = self.predict(seen)
        if not expectation.is_finite:
            raise self.not_finite()
        return expectation

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
        with torch.no_grad(), one_thread():
            hidden = self.predict_rooms(seen, rows, columns)
        if not hidden.is_finite:
            raise self.not_finite()
        return hidden

    def predict_rooms(
        self, seen: Observation, rows: Ints, columns: Ints | None
    ) -> CountDistribution:
        """Return the hidden counts of some rooms; arguments as for `expect_rooms`."""
        return take_cells(self.predict(seen).hidden_counts, rows, columns)

    def not_finite(self) -> PredictionError:
        """Return the error for an answer that is not finite, naming the checkpoint."""
        return PredictionError(
            f"{self.origin or type(self).__name__}: the model's answer is not finite (NaN or "
            "infinite); train it again"
        )


class Network(BeliefModel):
    """A model that is trained by the gradient of its loss on graphs."""

    def graph_of(self, seen: Observation, targets: Counts | None = None) -> Data:
        """Return an observation as the graph that the network reads, with its own edges."""
        return to_graph(self.reading_of(seen), edges=self.inputs.edges, targets=targets)

    def nodes_of(self, seen: Observation) -> Data | Nodes:
        """Return an observation in the form for predictions, without targets."""
        return self.graph_of(seen)

    def reading_of(self, seen: Observation) -> Observation:
        """Return an observation with the categories that the network reads.

        Raises:
            MismatchError: if the observation has others.
        """
        if seen.vocabulary == self.vocabulary:
            return seen
        return replace(seen, vocabulary=self.vocabulary, others=others_of(seen, self.vocabulary))

    @abstractmethod
    def loss(self, graphs: Data) -> torch.Tensor:
        """Return the loss that a training step lowers, for graphs with their targets `y`."""

    def cells_of(self, graphs: Data) -> int:
        """Return the number of (node, class) cells that `loss` averages over.

        Several processes that train together weight their losses by it.
        """
        return int(graphs.y.numel())

    @abstractmethod
    def validation_loss(self, graphs: Data) -> tuple[float, int]:
        """Return the sum of the loss over (node, class) cells, and their number."""


def take_cells(
    distribution: CountDistribution, rows: Ints, columns: Ints | None
) -> CountDistribution:
    """Return the distribution of some nodes `[M]` and classes `[M, A]`, None for all."""
    taken = distribution.take(rows)
    return taken if columns is None else taken.take_classes(columns)


def others_of(seen: Observation, vocabulary: tuple[str, ...]) -> Counts:
    """Return the seen objects outside the classes, `[N, V]`; none if the vocabulary is empty.

    Raises:
        MismatchError: if the observation has another vocabulary.
    """
    if seen.vocabulary == vocabulary:
        return seen.others
    if not seen.vocabulary:
        return np.zeros((len(seen.inputs), len(vocabulary)), dtype=np.int64)
    raise MismatchError(
        f"the observation has {len(seen.vocabulary)} categories outside the classes, expected the "
        f"{len(vocabulary)} that the model reads; make it with vocabulary=model.vocabulary"
    )


def to_array(tensor: torch.Tensor) -> np.ndarray[Any, np.dtype[np.float64]]:
    """Return a tensor as a float64 array."""
    return tensor.detach().cpu().numpy().astype(np.float64)


def share_of(graphs: Data) -> torch.Tensor:
    """Return the share of its objects of each class that each node hides, `[N, C]`.

    It is the node's hidden share, and 1 for a withheld class, as in `Observation.cell_share`.
    """
    share: torch.Tensor = graphs.hidden_share[:, None].expand_as(graphs.x)
    withheld: torch.Tensor | None = getattr(graphs, "withheld", None)
    return share if withheld is None else torch.where(withheld, torch.ones_like(share), share)


def building_numbers(graphs: Data) -> torch.Tensor:
    """Return the number of each node's building in a graph or a batch, `[N]` from 0."""
    return torch.cumsum(graphs.is_building.long(), dim=0) - 1
