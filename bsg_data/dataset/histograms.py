"""Histograms of classes at the nodes of interest (paper, section II: E × O).

Two arrays of the same shape `[N, C]`, N = 1 + R:

- *cells*: row 0 counts the objects of the null region, rows 1..R those of the rooms. Every object
  is in one cell, so masks are drawn on cells.
- *histograms*: row 0 counts the whole building, rows 1..R the rooms.

Objects outside the classes are counted by category. They carry information: a shower dial says
bathroom and a worktop says kitchen, though neither is a class.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts, Ints


def count_cells(
    room_index: npt.NDArray[np.integer], kind: npt.NDArray[np.integer], *, shape: tuple[int, int]
) -> Counts:
    """Count objects by room and kind.

    Args:
        room_index: `[O]` room 0..R of every object.
        kind: `[O]` kind 0..K-1 of every object, such as its class.
        shape: (1 + R, K).

    Returns:
        `[1 + R, K]` cells.
    """
    flat = room_index.astype(np.int64) * shape[1] + kind.astype(np.int64)
    return np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)


def to_histograms(cells: Counts) -> Counts:
    """Return cells `[..., N, C]` as histograms: row 0 becomes the sum over all rows.

    Examples:
        >>> to_histograms(np.array([[1, 0], [2, 3]])).tolist()
        [[3, 3], [2, 3]]
    """
    histograms = cells.copy()
    histograms[..., 0, :] = cells.sum(axis=-2)
    return histograms


def stack_histograms(cells: Counts, starts: Ints) -> Counts:
    """Return cells `[K, C]` of several buildings as histograms; `starts` has their first rows."""
    histograms = cells.copy()
    histograms[starts] = np.add.reduceat(cells, starts, axis=0)
    return histograms


def to_cells(histograms: Counts) -> Counts:
    """Return histograms `[..., N, C]` as cells: row 0 becomes the objects in no room.

    >>> to_cells(np.array([[3, 3], [2, 3]])).tolist()
    [[1, 0], [2, 3]]
    """
    cells = histograms.copy()
    cells[..., 0, :] -= histograms[..., 1:, :].sum(axis=-2)
    return cells


NO_CATEGORY = ""  # stands for nameless and unmapped objects: nothing to learn from


@dataclass(frozen=True, eq=False)
class OtherObjects:
    """The objects without a class of one scene."""

    # `[K]` names, sorted; `NO_CATEGORY` stands for objects without a category
    categories: tuple[str, ...]
    cells: Counts  # `[1 + R, K]` counts, row 0 the null region


def choose_vocabulary(others: Iterable[OtherObjects], *, min_scenes: int) -> tuple[str, ...]:
    """Return the sorted categories that occur in at least `min_scenes` of the scenes."""
    scenes = Counter(name for one in others for name in one.categories if name != NO_CATEGORY)
    return tuple(sorted(name for name, number in scenes.items() if number >= min_scenes))


def place_columns(categories: Sequence[str], vocabulary: Sequence[str]) -> npt.NDArray[np.int64]:
    """Return the column of the vocabulary of every category, -1 for one that is not in it.

    >>> place_columns(["tap", "zebra"], ["drawer", "tap"]).tolist()
    [1, -1]
    """
    number = {name: i for i, name in enumerate(vocabulary)}
    return np.array([number.get(name, -1) for name in categories], dtype=np.int64)
