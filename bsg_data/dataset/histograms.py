"""Histograms of classes at the nodes of interest (paper, section II: E × O).

Two arrays of the same shape `[N, C]`, N = 1 + R:

- *cells*: row 0 counts the objects of the null region, rows 1..R those of the rooms. Every object
  is in one cell, so masks are drawn on cells.
- *histograms*: row 0 counts the whole building, rows 1..R the rooms.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts


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


def to_cells(histograms: Counts) -> Counts:
    """Return histograms `[..., N, C]` as cells: row 0 becomes the objects in no room.

    >>> to_cells(np.array([[3, 3], [2, 3]])).tolist()
    [[1, 0], [2, 3]]
    """
    cells = histograms.copy()
    cells[..., 0, :] -= histograms[..., 1:, :].sum(axis=-2)
    return cells
