"""The rooms of the training buildings: complete, counted, or under masks.

Buildings are read one part of the dataset at a time, so only the result stays in memory.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import (
    MaskedBuildings,
)

Tally = tuple[Ints, Ints]  # distinct counts, rising, and the number of rooms with each


def read_rooms(
    data: Dataset, scenes: Sequence[str], *, most: int
) -> tuple[npt.NDArray[np.uint8], Ints]:
    """Return the counts of some rooms `[R, C]`, cut to `most`, and each room's building `[R]`.

    A class that the source has no word for counts as `most` + 1.
    """
    rooms: dict[str, npt.NDArray[np.uint8]] = {}
    for some in data.in_parts(scenes):
        for scene in some:
            counts = np.minimum(data.cells(scene)[1:], most)
            rooms[scene] = np.where(data.nameable(scene), counts, most + 1).astype(np.uint8)
    sizes = [len(rooms[scene]) for scene in scenes]
    joined = np.concatenate([rooms[scene] for scene in scenes])
    return joined, np.repeat(np.arange(len(scenes)), sizes)


def tally_rooms(data: Dataset, scenes: Sequence[str]) -> list[Tally]:
    """Return for every class `[C]` which counts occur in rooms, and in how many rooms each.

    Rooms whose source has no word for a class are left out; if all are, it is absent in one.
    """
    tallies = [Counter[int]() for _ in data.manifest.class_space.classes]
    for some in data.in_parts(scenes):
        rooms = np.concatenate([data.cells(scene)[1:] for scene in some])
        sizes = [len(data.cells(scene)) - 1 for scene in some]
        known = np.repeat([data.nameable(scene) for scene in some], sizes, axis=0)
        for tally, counts, own in zip(tallies, rooms.T, known.T, strict=True):
            values, times = np.unique(counts[own], return_counts=True)
            tally.update(dict(zip(values.tolist(), times.tolist(), strict=True)))
    every = [tally or Counter({0: 1}) for tally in tallies]
    both = [np.array(sorted(tally.items()), dtype=np.int64).reshape(-1, 2) for tally in every]
    return [(values_times[:, 0], values_times[:, 1]) for values_times in both]


def take_sample(masked: MaskedBuildings, *, most: int) -> MaskedBuildings:
    """Return a random sample of masked buildings in their order: all, if they have few nodes.

    It has at most `most` nodes, but one building at least.
    """
    rng = np.random.Generator(np.random.PCG64(0))
    order = np.argsort(rng.random(len(masked)), kind="stable")
    last = np.searchsorted(np.cumsum(np.diff(masked.seen.starts)[order]), most, side="right")
    if last == len(masked):
        return masked
    return masked.take(np.sort(order[: max(last, 1)]))
