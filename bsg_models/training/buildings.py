"""Deal the training buildings under masks in batches.

The order of an epoch depends only on (seed, epoch), and its masks on (the mask's own seed, epoch).
So neither depends on earlier epochs having run in this process.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import torch
from torch_geometric.data import Data
from torch_geometric.loader import DataLoader

from bsg_data.arrays import Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import (
    BATCH,
    MaskedBuildings,
    sample_masked,
    stack_masked,
    vary_fractions,
)
from bsg_data.recipes import MaskRecipe
from bsg_models.ceci.masked_graphs import MaskedGraphs
from bsg_models.ceci.network import Network
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.graphs import read_split
from bsg_models.inputs.nodes import Nodes
from bsg_models.training.count_gradients import CountGradients
from bsg_models.zoo.config import RunConfig

_VAL_DRAWS = 10  # of every val building, if the stored pairs are of another kind than the training


def feed_of(
    network: Network | CountGradients, config: RunConfig, data: Dataset
) -> TrainingGraphs | TrainingNodes:
    """Return the batches of every epoch in the form that the loss of a network takes."""
    if isinstance(network, CountGradients):
        return TrainingNodes(config, data, network=network)
    return TrainingGraphs(config, data, network=network)


class TrainingNodes:
    """The masked buildings of every epoch of one training, as the nodes that a count network reads.

    Stored pairs are held in memory; fresh masks are drawn a batch at a time.
    """

    def __init__(self, config: RunConfig, data: Dataset, *, network: CountGradients) -> None:
        self._config, self._data, self._network = config, data, network
        vocabulary = self._vocabulary = network.vocabulary
        fold, self._stored = config.data.fold, None
        self._scenes = scenes_of(data, "train", fold=fold)
        if config.data.masks == "fixed":
            self._stored = read_split(data, "train", fold=fold, vocabulary=vocabulary)
        self._number = len(self._scenes if self._stored is None else self._stored)

    @property
    def steps(self) -> int:
        """Number of steps of an epoch."""
        return -(-self._number // self._config.training.batch_size)

    def batches(self, epoch: int) -> Iterator[Nodes]:
        """Yield the batches of an epoch."""
        for some in self.masked(epoch):
            yield self._network.read(some.seen, some.targets)

    def masked(self, epoch: int) -> Iterator[MaskedBuildings]:
        """Yield the buildings of the batches of an epoch."""
        order, size = self._order(epoch), self._config.training.batch_size
        choice = self._config.data
        recipes = vary_fractions(choice.mask, choice.fractions, epoch, len(self._scenes))
        for first in range(0, self._number, size):
            yield self._take(order[first : first + size], recipes, epoch)

    def _take(self, numbers: Ints, recipes: list[MaskRecipe], epoch: int) -> MaskedBuildings:
        if self._stored is not None:
            return self._stored.take(numbers)
        return sample_masked(
            self._data,
            [self._scenes[number] for number in numbers],
            mask=[recipes[number] for number in numbers],
            draw=epoch,
            vocabulary=self._vocabulary,
        )

    def _order(self, epoch: int) -> Ints:
        order = torch.Generator().manual_seed(self._config.seed_of(epoch))
        torch.empty((), dtype=torch.int64).random_(generator=order)  # as torch's loader did
        permuted: Ints = torch.randperm(self._number, generator=order).numpy()
        return permuted


class TrainingGraphs:
    """The graphs of every epoch of a training: stored pairs, as in the paper, or fresh masks.

    They have the fields that the network reads, `edge_index` and `y`.
    """

    def __init__(self, config: RunConfig, data: Dataset, *, network: Network) -> None:
        self._config, self._data, self._vocabulary = config, data, network.vocabulary
        self._reads = (*network.reads, "edge_index", "y")
        self._first = self._take(1)
        self.steps = -(-len(self._first) // config.training.batch_size)

    def batches(self, epoch: int) -> DataLoader:
        """Return the batches of an epoch, whose order depends on (seed, epoch) alone."""
        is_drawn = self._config.data.masks == "fixed" or epoch == 1
        return DataLoader(
            self._first if is_drawn else self._take(epoch),
            batch_size=self._config.training.batch_size,
            shuffle=True,
            generator=torch.Generator().manual_seed(self._config.seed_of(epoch)),
        )

    def _take(self, epoch: int) -> list[Data]:
        """Return the stored pairs of the train buildings, or their masks of an epoch."""
        choice = self._config.data
        how: dict[str, Any] = {
            "fold": choice.fold,
            "edges": choice.edges,
            "vocabulary": self._vocabulary,
        }
        if choice.masks == "fixed":
            graphs = MaskedGraphs.stored(self._data, "train", **how)
        else:
            how |= {"mask": choice.mask, "draw": epoch, "fractions": choice.fractions}
            graphs = MaskedGraphs.fresh(self._data, "train", **how)
        return [Data(**{name: one[name] for name in self._reads}) for one in graphs]


def validation_buildings(
    config: RunConfig, data: Dataset, *, vocabulary: tuple[str, ...]
) -> MaskedBuildings:
    """Return val under masks of the kind of the training: stored pairs, or ten fresh masks."""
    choice, pairs = config.data, data.manifest.pairs
    if not choice.needs_own_masks(pairs.mask if pairs else None):
        return read_split(data, "val", fold=choice.fold, vocabulary=vocabulary)
    scenes = scenes_of(data, "val", fold=choice.fold)
    return mask_as_trained(config, data, scenes, vocabulary=vocabulary, draws=_VAL_DRAWS)


def mask_as_trained(
    config: RunConfig,
    data: Dataset,
    scenes: Sequence[str],
    *,
    vocabulary: tuple[str, ...],
    draws: int,
) -> MaskedBuildings:
    """Return some buildings under fresh masks of the kind of a training."""
    drawn = []
    for first in range(0, len(scenes), BATCH):
        rows = slice(first, first + BATCH)
        for draw in range(draws):
            own = vary_fractions(config.data.mask, config.data.fractions, draw, len(scenes))[rows]
            drawn.append(
                sample_masked(data, scenes[rows], mask=own, draw=draw, vocabulary=vocabulary)
            )
    return stack_masked(drawn)
