"""Stream or sample training rooms under masks, for models that are fitted by counting.

Models that need sums read a stream: all masks of some buildings, then of the next. So each part of
the dataset is read once, and only one is in memory. Models that need everything at once read a
sample of `MOST_ROOMS` rooms, and report it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import (
    BATCH,
    MaskedBuildings,
    sample_masked,
    stack_masked,
    stream_sampled,
)
from bsg_data.recipes import MaskRecipe
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.settings import DataConfig

MOST_ROOMS = 10_000  # rooms that a model holds at once, each under all of its masks


def stream_uniform(data: Dataset, choice: DataConfig, *, draws: int) -> Iterator[MaskedBuildings]:
    """Yield the training buildings under uniform masks of the choice's fraction.

    The masks are uniform whatever the strategy, because only partly seen rooms show what one class
    says about another.

    Raises:
        TrainingError: if the fraction is 0.
    """
    if not choice.mask.fraction:
        raise TrainingError("masks that hide nothing teach nothing: raise data.mask.fraction")
    mask = MaskRecipe(fraction=choice.mask.fraction, seed=choice.mask.seed)
    scenes = scenes_of(data, "train", fold=choice.fold)
    streams = [stream_sampled(data, scenes, mask=mask, draw=draw) for draw in range(draws)]
    for _ in range(0, len(scenes), BATCH):
        yield from map(next, streams)


def choose_buildings(
    data: Dataset, choice: DataConfig, *, most: int = MOST_ROOMS
) -> tuple[str, ...]:
    """Return the training buildings, or a random sample if they have too many rooms.

    Args:
        data: an open dataset.
        choice: of its training buildings; the seed of its mask is that of the sample.
        most: limit of rooms; at least one building is chosen.
    """
    scenes = scenes_of(data, "train", fold=choice.fold)
    sizes = {s: len(data.cells(s)) - 1 for some in data.in_parts(scenes) for s in some}
    rng = np.random.Generator(np.random.PCG64(choice.mask.seed))
    chosen = choose_within(rng.random(len(scenes)), [sizes[scene] for scene in scenes], most=most)
    return tuple(scene for scene, there in zip(scenes, chosen, strict=True) if there)


def choose_within(keys: Floats, sizes: Sequence[int] | Ints, *, most: int) -> Bools:
    """Return which things are kept within a limit of total size, the lowest keys first, `[B]`.

    Args:
        keys: `[B]`.
        sizes: `[B]`.
        most: limit of the total size; the first thing is kept in any case.
    """
    order = np.argsort(keys, kind="stable")
    kept = np.zeros(len(keys), dtype=bool)
    kept[order[np.cumsum(np.asarray(sizes)[order]) <= most]] = True
    kept[order[:1]] = True
    return kept


def sample_chosen(
    data: Dataset,
    choice: DataConfig,
    scenes: Sequence[str],
    *,
    draws: int,
    vocabulary: tuple[str, ...] = (),
) -> MaskedBuildings:
    """Return some buildings under the choice's own fresh masks, all at once."""
    return stack_masked(
        [
            sample_masked(
                data,
                scenes,
                mask=choice.fresh_mask,
                draw=draw,
                fractions=choice.fractions,
                vocabulary=vocabulary,
            )
            for draw in range(draws)
        ]
    )


def describe_sample(chosen: int, buildings: int) -> str:
    """Return a note that a model was fitted to a part of the training buildings."""
    return (
        f"fitted to a random sample of {chosen:,} of {buildings:,} training buildings: about "
        f"{MOST_ROOMS:,} rooms, its limit in memory"
    )


def take_sample(
    batches: Iterable[MaskedBuildings], *, most: int, seed: int = 0
) -> tuple[MaskedBuildings, int]:
    """Return a random sample of masked buildings in their order, and the number of all.

    Memory holds one batch and twice the sample. The sample depends on the buildings and the seed,
    not on the batches. It contains all buildings if they have at most `most` rooms.

    Args:
        batches: one or more.
        most: limit of rooms, and separately of buildings.
        seed: of the sample.
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    sample, number = _Sample(most), 0
    for batch in batches:
        sample.add(batch, rng.random(len(batch)))
        number += len(batch)
    return sample.take(), number


class _Sample:
    """The buildings with the lowest keys so far."""

    def __init__(self, most: int) -> None:
        self._most = most
        self._parts: list[MaskedBuildings] = []
        self._keys: list[Floats] = []
        self._limit = np.inf  # the lowest key that was left out

    def add(self, batch: MaskedBuildings, keys: Floats) -> None:
        """Add the buildings whose keys are low enough."""
        below = np.flatnonzero(keys < self._limit)
        if not len(below):
            return
        self._parts.append(batch if len(below) == len(batch) else batch.take(below))
        self._keys.append(keys[below])
        if sum(len(part.targets) for part in self._parts) > 2 * self._most:
            self._thin()

    def take(self) -> MaskedBuildings:
        """Return the sample of everything added."""
        self._thin()
        return self._parts[0]

    def _thin(self) -> None:
        masked, keys = stack_masked(self._parts), np.concatenate(self._keys)
        kept = choose_within(keys, np.diff(masked.seen.starts), most=self._most)
        if not kept.all():
            self._limit = keys[~kept].min()
            masked, keys = masked.take(np.flatnonzero(kept)), keys[kept]
        self._parts, self._keys = [masked], [keys]
