"""Deal the training buildings under masks in batches.

The order of an epoch depends only on (seed, epoch), and its masks on (the mask's own seed, epoch).
So neither depends on earlier epochs having run in this process.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import torch
from torch_geometric.loader import DataLoader

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import (
    BATCH,
    MaskedBuildings,
    sample_masked,
    stack_masked,
    vary_fractions,
)
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.graphs import read_split
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.torch_module import TorchModule

_VAL_DRAWS = 10  # of every val building, if the stored pairs are of another kind than the training


class TrainingBatches:
    """The masked buildings of every epoch of a training, in the form that the network's loss takes.

    Stored pairs are held in memory; fresh masks are drawn a batch at a time.
    """

    def __init__(self, config: RunConfig, data: Dataset, *, network: TorchModule) -> None:
        self._config, self._data, self._network = config, data, network
        self._scenes = scenes_of(data, "train", fold=config.data.fold)
        self._stored = None
        if config.data.masks == "fixed":
            fold, vocabulary = config.data.fold, network.vocabulary
            self._stored = read_split(data, "train", fold=fold, vocabulary=vocabulary)
        self._number = len(self._stored or self._scenes)
        self.steps = -(-self._number // config.training.batch_size)

    def of(self, epoch: int) -> Iterator[Any]:
        """Yield the batches of an epoch."""
        for masked in self.masked(epoch):
            yield self._network.read(masked.seen, masked.targets)

    def masked(self, epoch: int) -> Iterator[MaskedBuildings]:
        """Yield the buildings of the batches of an epoch, as PyG's loader shuffles them."""
        choice, order = (
            self._config.data,
            torch.Generator().manual_seed(self._config.seed_of(epoch)),
        )
        recipes = vary_fractions(choice.mask, choice.fractions, epoch, len(self._scenes))
        size, numbers = self._config.training.batch_size, range(self._number)
        for some in DataLoader(numbers, batch_size=size, shuffle=True, generator=order):
            if self._stored is not None:
                yield self._stored.take(some.numpy())
                continue
            yield sample_masked(
                self._data,
                [self._scenes[number] for number in some],
                mask=[recipes[number] for number in some],
                draw=epoch,
                vocabulary=self._network.vocabulary,
            )


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
    choice, drawn = config.data, []
    for first in range(0, len(scenes), BATCH):
        rows = slice(first, first + BATCH)
        for draw in range(draws):
            masks = vary_fractions(choice.mask, choice.fractions, draw, len(scenes))[rows]
            some = sample_masked(data, scenes[rows], mask=masks, draw=draw, vocabulary=vocabulary)
            drawn.append(some)
    return stack_masked(drawn)
