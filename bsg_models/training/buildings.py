"""Deal the masked buildings of a training: every epoch in its own order, one window at a time.

The training data are never all in memory. An epoch shuffles the parts of the dataset (or the files
of its stored pairs), loads a window of them, shuffles its buildings and deals them in batches. Data
that fit into one window are shuffled as a whole.

The order of an epoch depends only on (seed, epoch), and its masks on (the mask's own seed, epoch).
So neither depends on earlier epochs having run in this process, nor on the number of processes.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace
from functools import cached_property
from typing import cast

import numpy as np
import torch

from bsg_data.arrays import Counts, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import (
    BATCH,
    MaskedBuildings,
    sample_each,
    stack_masked,
    vary_fractions,
)
from bsg_data.observation.pairs import fits_pairs
from bsg_data.recipes import PairsRecipe
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.inputs.graphs import in_batches, read_split, stream_split
from bsg_models.training.ranks import Ranks
from bsg_models.zoo.config import RunConfig

WINDOW = 4096  # masked buildings that are shuffled together
_VAL_DRAWS = 10  # of every val building, if the stored pairs are of another kind than the training

# Masked buildings in memory, and those that this process takes, in their order.
_Dealt = tuple[MaskedBuildings, Ints]


class TrainingBuildings:
    """The masked buildings of every epoch of one training, from an open dataset.

    Args:
        config: of the run.
        data: an open dataset.
        vocabulary: categories outside the classes that the model reads.
        ranks: this process among those of the training.
        window: number of masked buildings that are shuffled together.
    """

    def __init__(
        self,
        config: RunConfig,
        data: Dataset,
        *,
        vocabulary: tuple[str, ...],
        ranks: Ranks | None = None,
        window: int = WINDOW,
    ) -> None:
        self._config, self._data, self._vocabulary = config, data, vocabulary
        self._ranks, self._window = ranks or Ranks(), window
        self._share = self._ranks.share_of(config.training.batch_size)
        self._scenes = scenes_of(data, "train", fold=config.data.fold)
        self._number = len(self._scenes)
        if config.data.masks == "fixed":
            next(self._stored(None))  # raises for missing pairs before anything is replaced
            parts = data.in_parts(self._scenes)
            fitting = sum(fits_pairs(data.cells(scene)) for part in parts for scene in part)
            self._number = fitting * (data.manifest.pairs or PairsRecipe()).draws
        if self._number < self._ranks.size:
            raise TrainingError(
                f"{data.path}: {self._number} training buildings cannot be dealt to "
                f"{self._ranks.size} processes; start fewer processes with torchrun"
            )

    @property
    def steps(self) -> int:
        """Number of steps of an epoch."""
        return -(-self._number // self._config.training.batch_size)

    def batches(self, epoch: int) -> Iterator[MaskedBuildings]:
        """Yield this process's share of every batch of an epoch, one or more buildings each.

        If the last batch has fewer buildings than there are processes, some processes get no share
        of it.
        """
        seed = epoch_seed(self._config, epoch)
        order = torch.Generator().manual_seed(seed)
        torch.empty((), dtype=torch.int64).random_(generator=order)  # as torch's loader did
        whole = self._number <= self._window
        parts = None if whole else np.random.Generator(np.random.PCG64(seed))
        if self._config.data.masks == "fixed":
            dealt = self._deal_stored(order, parts)
        else:
            dealt = self._deal_fresh(epoch, order, parts)
        return in_batches(_cut(dealt, self._share), self._share)

    def _deal_fresh(
        self, epoch: int, order: torch.Generator, parts: np.random.Generator | None
    ) -> Iterator[_Dealt]:
        """Yield mask number `epoch` of the training buildings, window after window."""
        choice = self._config.data
        recipes = vary_fractions(choice.fresh_mask, choice.fractions, epoch, len(self._scenes))
        place = np.zeros(len(self._scenes), dtype=np.int64)  # index of a building in the window
        first = 0
        for window in self._windows(parts):
            dealt = window[_permute(len(window), order)]
            mine = dealt[self._mine(first, len(dealt))]
            first += len(dealt)
            if not len(mine):
                continue
            held = window[np.isin(window, mine)]  # in the order of the tables
            place[held] = np.arange(len(held))
            some = [
                sample_each(
                    self._data,
                    [self._scenes[number] for number in numbers],
                    [recipes[number] for number in numbers],
                    draw=epoch,
                    vocabulary=self._vocabulary,
                )
                for numbers in np.split(held, range(BATCH, len(held), BATCH))
            ]
            yield stack_masked([_narrow(one) for one in some]), place[mine]

    def _windows(self, parts: np.random.Generator | None) -> Iterator[Ints]:
        """Yield the numbers of the buildings of every window: whole parts, in a random order.

        Without a generator, yield all of them, in the order of the split.
        """
        if parts is None:
            yield np.arange(len(self._scenes))
            return
        number = {scene: place for place, scene in enumerate(self._scenes)}
        of_parts = [
            np.array([number[scene] for scene in part], dtype=np.int64)
            for part in self._data.in_parts(self._scenes)
        ]
        held: list[Ints] = []
        for part in parts.permutation(len(of_parts)).tolist():
            held.append(of_parts[part])
            if sum(map(len, held)) >= self._window:
                yield np.concatenate(held)
                held = []
        if held:
            yield np.concatenate(held)

    def _deal_stored(
        self, order: torch.Generator, parts: np.random.Generator | None
    ) -> Iterator[_Dealt]:
        """Yield the stored pairs of the training buildings, window after window."""
        first = 0
        for window in self._stored_windows(parts):
            dealt = _permute(len(window), order)
            yield window, dealt[self._mine(first, len(dealt))]
            first += len(dealt)

    def _stored_windows(self, parts: np.random.Generator | None) -> Iterator[MaskedBuildings]:
        if parts is None:
            yield self._every_pair
            return
        held: list[MaskedBuildings] = []
        for some in self._stored(parts):
            held.append(_narrow(some))
            if sum(map(len, held)) >= self._window:
                yield stack_masked(held)
                held = []
        if held:
            yield stack_masked(held)

    @cached_property
    def _every_pair(self) -> MaskedBuildings:
        """The stored pairs of the training buildings, if one window holds all of them."""
        fold = self._config.data.fold
        return read_split(self._data, "train", fold=fold, vocabulary=self._vocabulary)

    def _stored(self, shuffle: np.random.Generator | None) -> Iterator[MaskedBuildings]:
        fold = self._config.data.fold
        return stream_split(
            self._data, "train", fold=fold, vocabulary=self._vocabulary, shuffle=shuffle
        )

    def _mine(self, first: int, number: int) -> Ints:
        """Return which of some places of the epoch, from the first, belong to this process."""
        places = np.arange(first, first + number)
        size = self._config.training.batch_size
        return np.flatnonzero(self._ranks.takes(places, batch_size=size))


def epoch_seed(config: RunConfig, epoch: int, *, rank: int = 0) -> int:
    """Return the seed of an epoch: of its order, and of the dropout of one process."""
    entropy = [config.seed, epoch, rank] if rank else [config.seed, epoch]
    return int(np.random.SeedSequence(entropy).generate_state(1)[0])


def stream_validation(
    config: RunConfig, data: Dataset, *, vocabulary: tuple[str, ...]
) -> Iterator[MaskedBuildings]:
    """Yield val under masks of the kind of the training: stored pairs, or ten fresh masks.

    Buildings are yielded in batches, which limits the memory.

    Args:
        config: of the run.
        data: an open dataset.
        vocabulary: categories outside the classes that the model reads.
    """
    choice = config.data
    if not _draws_own(config, data):
        yield from stream_split(data, "val", fold=choice.fold, vocabulary=vocabulary)
        return
    scenes = scenes_of(data, "val", fold=choice.fold)
    recipes = [
        vary_fractions(choice.fresh_mask, choice.fractions, draw, len(scenes))
        for draw in range(_VAL_DRAWS)
    ]
    for first in range(0, len(scenes), BATCH):  # all draws of a batch, so parts are read once
        some = slice(first, first + BATCH)
        for draw, own in enumerate(recipes):
            yield sample_each(data, scenes[some], own[some], draw=draw, vocabulary=vocabulary)


def count_validation(config: RunConfig, data: Dataset) -> int:
    """Return how many masked buildings `stream_validation` yields."""
    pairs = data.manifest.pairs
    draws = _VAL_DRAWS if _draws_own(config, data) or pairs is None else pairs.draws
    return draws * len(scenes_of(data, "val", fold=config.data.fold))


def validation_buildings(
    config: RunConfig, data: Dataset, *, vocabulary: tuple[str, ...]
) -> MaskedBuildings:
    """Return everything that `stream_validation` yields, as one."""
    return stack_masked(list(stream_validation(config, data, vocabulary=vocabulary)))


def _draws_own(config: RunConfig, data: Dataset) -> bool:
    pairs = data.manifest.pairs
    return config.data.needs_own_masks(pairs.mask if pairs else None)


def _permute(number: int, order: torch.Generator) -> Ints:
    permuted: Ints = torch.randperm(number, generator=order).numpy()
    return permuted


def _cut(dealt: Iterable[_Dealt], size: int) -> Iterator[MaskedBuildings]:
    """Yield dealt buildings cut at the ends of batches, so that few are joined again."""
    missing = size
    for window, mine in dealt:
        first = 0
        while first < len(mine):
            some = window.take(mine[first : first + missing])
            first += len(some)
            missing = missing - len(some) or size
            yield some


def _narrow(masked: MaskedBuildings) -> MaskedBuildings:
    """Return the same with the counts of the wide vocabulary in as few bytes as possible.

    A window of 4,096 buildings of 15 rooms and 1,600 categories then takes 0.1 GB instead of 0.8
    GB.
    """
    others = masked.seen.others
    if not others.size:
        return masked
    narrow = cast(Counts, others.astype(np.min_scalar_type(int(others.max()))))
    return replace(masked, seen=replace(masked.seen, others=narrow))
