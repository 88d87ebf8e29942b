"""Find the grid cells that surfaces touch, and the largest connected part of each surface."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats, find_runs
from bsg_data.geometry.colour_labels import Labels

CELL = 0.1  # metres; what is closer than two of these is one part


@dataclass(frozen=True, slots=True)
class SurfaceCells:
    """Cells of a grid by label."""

    keys: npt.NDArray[np.uint64]  # [P] label and place, 16 bits each of label, x, y and z
    low: Floats  # [P, 3] lowest corner of the points in each
    high: Floats  # [P, 3] their highest corner

    @classmethod
    def of_points(cls, points: Floats, labels: Labels) -> SurfaceCells:
        """Return the cells that points `[3, P]` of labels `[P]` lie in."""
        x, y, z = (np.floor(points / CELL) + 2**15).astype(np.uint64)
        keys = np.asarray(labels.astype(np.uint64) << 48 | x << 32 | y << 16 | z, dtype=np.uint64)
        starts, keys = find_runs(keys)  # neighbours mostly lie in one cell: sort few
        if not len(keys):
            return cls(keys, np.zeros((0, 3)), np.zeros((0, 3)))
        low = np.minimum.reduceat(points, starts, axis=1).T
        return cls(keys, low, np.maximum.reduceat(points, starts, axis=1).T).merge()

    def merge(self) -> SurfaceCells:
        """Return every cell once, in the order of the keys."""
        if not len(self.keys):
            return self
        order = np.argsort(self.keys)
        starts, keys = find_runs(self.keys[order])
        low = np.minimum.reduceat(self.low[order], starts, axis=0)
        return SurfaceCells(keys, low, np.maximum.reduceat(self.high[order], starts, axis=0))


def join_cells(cells: Sequence[SurfaceCells]) -> SurfaceCells:
    """Return the cells of all, every cell once."""
    if not cells:
        return SurfaceCells(np.zeros(0, dtype=np.uint64), np.zeros((0, 3)), np.zeros((0, 3)))
    return SurfaceCells(
        np.concatenate([one.keys for one in cells]),
        np.concatenate([one.low for one in cells]),
        np.concatenate([one.high for one in cells]),
    ).merge()


def keep_largest_parts(cells: SurfaceCells) -> SurfaceCells:
    """Keep the cells of the largest part of every label: cells that touch are of one part."""
    from scipy.sparse import coo_array  # Imported here because importing SciPy is slow.
    from scipy.sparse.csgraph import connected_components

    keys = cells.keys
    if not len(keys):
        return cells
    rows, columns = [], []
    for step in _COLUMNS:
        # A cell below, beside or above in that column is one of three that follow one another.
        place = np.searchsorted(keys, keys + step - np.uint64(1))
        for further in range(3):
            other = np.minimum(place + further, len(keys) - 1)
            met = (keys[other] - (keys + step - np.uint64(1))) <= 2
            met &= other > np.arange(len(keys))
            rows.append(np.flatnonzero(met))
            columns.append(other[met])
    row, column = np.concatenate(rows), np.concatenate(columns)
    touching = coo_array((np.ones(len(row), bool), (row, column)), shape=(len(keys), len(keys)))
    _, part = connected_components(touching, directed=False)
    size = np.bincount(part)[part]
    starts, _ = find_runs(keys >> np.uint64(48))
    most = np.maximum.reduceat(size, starts)
    counts = np.diff(np.append(starts, len(keys)))
    best = np.where(size == np.repeat(most, counts), part, part.max() + 1)
    kept = part == np.repeat(np.minimum.reduceat(best, starts), counts)  # ties: the first
    return SurfaceCells(keys[kept], cells.low[kept], cells.high[kept])


# Columns beside that of a cell, as differences of keys: half of the eight, and its own.
_COLUMNS = tuple(
    np.uint64(x * 2**32 + y * 2**16) for x, y in ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
)
