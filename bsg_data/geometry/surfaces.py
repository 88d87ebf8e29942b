"""Surfaces as triangles, and as the cells of a grid that they touch.

Triangles are three arrays of corners, one row per axis, because sums of rows are faster.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats, Ints, find_runs

Labels = npt.NDArray[np.uint16]

CELL = 0.1  # metres; what is closer than two of these is one part
# Columns beside that of a cell, as differences of keys: half of the eight, and its own.
_COLUMNS = tuple(
    np.uint64(x * 2**32 + y * 2**16) for x, y in ((0, 0), (0, 1), (1, -1), (1, 0), (1, 1))
)


def take_corners(points: Floats, faces: Ints) -> tuple[Floats, Floats, Floats]:
    """Return the corners `[D, F]` each of faces `[3, F]` of points `[D, V]`."""
    return points[:, faces[0]], points[:, faces[1]], points[:, faces[2]]


def split_corners(corners: Floats) -> tuple[Floats, Floats, Floats]:
    """Return the corners `[3, F]` each of triangles `[F, 3, 3]`."""
    a, b, c = np.ascontiguousarray(corners.transpose(1, 2, 0))
    return a, b, c


def find_spans(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and the highest coordinates of triangles."""
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def measure_areas(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the area of every triangle `[F]`."""
    (ux, uy, uz), (vx, vy, vz) = b - a, c - a
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return np.asarray(np.sqrt(x * x + y * y + z * z) / 2)


def find_longest(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the longest side of every triangle `[F]`."""
    sides = [x * x + y * y + z * z for x, y, z in (b - a, c - b, a - c)]
    return np.asarray(np.sqrt(np.maximum(np.maximum(sides[0], sides[1]), sides[2])))


def divide_triangle(n: int, start: int, stop: int) -> Floats:
    """Return centroids of the small triangles of a triangle cut n times, as weights `[..., 3]`.

    There are n² in n rows; these are of rows `start` to `stop`.
    """
    rows, columns = np.meshgrid(np.arange(start, stop), np.arange(n), indexing="ij")
    row, column = rows.ravel(), columns.ravel()
    upright, flipped = row + column < n, row + column < n - 1
    first = np.stack([row[upright] + 1 / 3, column[upright] + 1 / 3], axis=1)
    second = np.stack([row[flipped] + 2 / 3, column[flipped] + 2 / 3], axis=1)
    two = np.concatenate([first, second]) / n
    return np.concatenate([1 - two.sum(axis=1, keepdims=True), two], axis=1)


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
    """Return the cells of one surface or more, every cell once."""
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
