"""Measure metrics batch by batch, for all resamples of the buildings at once.

The resamples depend only on the number of buildings, so they are known before the first batch. A
metric therefore keeps sums under each of W weights (the data, and every resample) instead of its
nodes. A building takes two bytes per resample.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar, cast

import numpy as np
import numpy.typing as npt
from scipy import sparse

from bsg_data.arrays import Ints
from bsg_models.evaluation.metrics import Floats
from bsg_models.evaluation.truth import Prediction

Key = tuple[str, str]  # node set, part
Weights = npt.NDArray[Any]  # `[B, W]` of floats or of whole numbers


@dataclass(frozen=True, slots=True)
class Values:
    """A metric under each of W weights."""

    values: Mapping[Key, Floats]  # (node set, part) → `[W]`; nan if it is not defined
    nodes: Mapping[Key, int]  # (node set, part) → number of nodes behind it


@dataclass(frozen=True, eq=False)
class Batch:
    """Some nodes of a prediction, with the weights of all B buildings."""

    prediction: Prediction  # of N nodes
    building: Ints  # `[N]` 0..B-1, the number of each node's building
    weights: Weights  # `[B, W]` how often each building counts

    def sum(self, rows: Ints, values: Floats) -> Floats:
        """Return the sums over some nodes under every weight, `[W, K]`.

        Args:
            rows: `[M]` of the nodes.
            values: `[M, K]` what each node adds.
        """
        there, place = np.unique(self.building[rows], return_inverse=True)
        one_of = sparse.csr_array(
            (np.ones(len(rows)), (place, np.arange(len(rows)))), shape=(len(there), len(rows))
        )
        return np.asarray(self.weights[there].T.astype(float) @ (one_of @ values))

    def sum_products(self, rows: Ints, values: Floats) -> Floats:
        """Return Σ z zᵀ over some nodes under every weight, `[W, 1 + K, 1 + K]`.

        With z = (1, values), its first row is the number of nodes, then the sums of the values.

        Args:
            rows: `[M]` of the nodes.
            values: `[M, K]` of each node.
        """
        if not len(rows):
            return np.zeros((self.weights.shape[1], *2 * (1 + values.shape[1],)))
        augmented = np.column_stack([np.ones(len(rows)), values])
        there, place = np.unique(self.building[rows], return_inverse=True)
        order = np.argsort(place, kind="stable")
        ends = np.searchsorted(place[order], np.arange(1, len(there)))
        products = [own.T @ own for own in np.split(augmented[order], ends)]
        weights = self.weights[there].T.astype(float)
        return np.tensordot(weights, np.stack(products), axes=1)


class Accumulator(ABC):
    """The sums of a metric over the batches so far."""

    @abstractmethod
    def add(self, batch: Batch) -> None:
        """Add some nodes; those of a building may come in several batches."""

    @abstractmethod
    def finish(self) -> Values:
        """Return the metric over all batches."""


class SharedSums(ABC):
    """Sums that several metrics of one stream read; they are kept once for all of them."""

    @abstractmethod
    def __init__(self, weights: Weights) -> None:
        """Start without nodes."""

    @abstractmethod
    def add(self, batch: Batch) -> None:
        """Add some nodes."""


_Shared = TypeVar("_Shared", bound=SharedSums)


class Stream:
    """The batches of one model on one split, and the sums that its metrics share.

    Args:
        scene_ids: `[B]` of all buildings that will come.
        weights: `[B, W]` how often each building counts.
    """

    def __init__(self, scene_ids: Sequence[str], weights: Weights) -> None:
        self.weights = weights
        self._number = {scene: number for number, scene in enumerate(scene_ids)}
        self._shared: dict[type[SharedSums], SharedSums] = {}

    @property
    def width(self) -> int:
        """Number of weights W."""
        return int(self.weights.shape[1])

    def share(self, kind: type[_Shared]) -> _Shared:
        """Return the shared sums of this kind; all metrics that ask get the same object."""
        if kind not in self._shared:
            self._shared[kind] = kind(self.weights)
        return cast(_Shared, self._shared[kind])

    def batch(self, prediction: Prediction) -> Batch:
        """Add some nodes to the shared sums, and return them for the metrics."""
        truth = prediction.truth
        numbers = np.array([self._number[scene] for scene in truth.scene_ids], dtype=np.int64)
        batch = Batch(prediction, numbers[truth.building], self.weights)
        for shared in self._shared.values():
            shared.add(batch)
        return batch
