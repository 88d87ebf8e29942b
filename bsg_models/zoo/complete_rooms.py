"""Read the content of training rooms, without a mask: compact counts, and tallies of them.

Buildings are read one part of the dataset at a time, so only the result stays in memory.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Ints
from bsg_data.dataset.dataset import Dataset

Tally = tuple[Ints, Ints]  # distinct counts, rising, and the number of rooms with each


def read_rooms(
    data: Dataset, scenes: Sequence[str], *, most: int
) -> tuple[npt.NDArray[np.uint8], Ints]:
    """Return the content of the rooms of some scenes, one byte per class.

    Args:
        data: an open dataset.
        scenes: B of its scenes, in the order of the answer.
        most: limit to which larger counts are cut, at most 255.

    Returns:
        The counts `[R, C]`, and the number of the building of each room, `[R]`.
    """
    rooms: dict[str, npt.NDArray[np.uint8]] = {}
    for some in data.in_parts(scenes):
        for scene in some:
            rooms[scene] = np.minimum(data.cells(scene)[1:], most).astype(np.uint8)
    sizes = [len(rooms[scene]) for scene in scenes]
    counts = np.concatenate([rooms[scene] for scene in scenes])
    return counts, np.repeat(np.arange(len(scenes)), sizes)


def tally_rooms(data: Dataset, scenes: Sequence[str]) -> list[Tally]:
    """Return for every class `[C]` which counts occur in rooms, and in how many rooms each."""
    classes = len(data.manifest.class_space.classes)
    number, tallies = 0, np.zeros((2, 0), dtype=np.int64)
    for rooms in _each_part(data, scenes):
        number += len(rooms)
        there = np.nonzero(rooms)
        pairs, times = np.unique(rooms[there] * classes + there[1], return_counts=True)
        tallies = _add(tallies, np.stack([pairs, times]))
    counts, owners = np.divmod(tallies[0], max(classes, 1))
    return [
        _with_none(counts[owners == c], tallies[1, owners == c], rooms=number)
        for c in range(classes)
    ]


def _each_part(data: Dataset, scenes: Sequence[str]) -> Iterator[Ints]:
    """Yield the counts `[R, C]` of the rooms of every part."""
    for some in data.in_parts(scenes):
        yield np.concatenate([data.cells(scene)[1:] for scene in some])


def _with_none(counts: Ints, times: Ints, *, rooms: int) -> Tally:
    """Return a tally of counts above 0 completed by the rooms with none, if there are any."""
    without = rooms - int(times.sum())
    if not without:
        return counts, times
    return np.concatenate([[0], counts]), np.concatenate([[without], times])


def _add(one: Ints, other: Ints) -> Ints:
    """Return the sum of two tallies, values over times `[2, n]`."""
    both = np.concatenate([one, other], axis=1)
    values, places = np.unique(both[0], return_inverse=True)
    return np.stack([values, np.bincount(places, both[1], len(values)).astype(np.int64)])
