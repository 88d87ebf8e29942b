"""Surfaces as triangles, and as the cells of a grid that they touch.

Triangles are three arrays of corners, one row per axis, because sums of rows are faster.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats, Ints, find_runs

Labels = npt.NDArray[np.uint16]
Halves = npt.NDArray[np.int32]
_Numbers = TypeVar("_Numbers", Floats, Ints, Halves)

CELL = 0.1  # metres; what is closer than two of these is one part
BLOCK = 2**14  # faces or points at once, whose arrays stay in a cache of the processor
# Columns beside that of a cell, as differences of keys: half of the eight.
_COLUMNS = tuple(np.uint64(x * 2**32 + y * 2**16) for x, y in ((0, 1), (1, -1), (1, 0), (1, 1)))


def take_corners(points: _Numbers, faces: Ints) -> tuple[_Numbers, _Numbers, _Numbers]:
    """Return the corners `[..., F]` each of faces `[3, F]` of points `[..., V]`."""
    a, b, c = (points.take(corner, axis=-1) for corner in faces)
    return a, b, c


def find_spans(a: _Numbers, b: _Numbers, c: _Numbers) -> tuple[_Numbers, _Numbers]:
    """Return the lowest and the highest coordinates of triangles."""
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def measure_areas(u: Floats, v: Floats) -> Floats:
    """Return the area of every triangle `[F]`, from two of its sides."""
    (ux, uy, uz), (vx, vy, vz) = u, v
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
    low: Floats  # [3, P] lowest corner of the points in each
    high: Floats  # [3, P] their highest corner

    @classmethod
    def of_points(cls, points: Floats, labels: Labels, *, first: int) -> SurfaceCells:
        """Return the cells that points `[3, P]` of labels `[P]` from `first` up lie in."""
        keys, y, z = np.floor(points / CELL)
        for axis in (y, z):
            keys *= 2**16
            keys += axis
        keys += 2**47 + 2**31 + 2**15
        named = keys.astype(np.int64).view(np.uint64)
        named |= labels.astype(np.uint64) << np.uint64(48)
        order = np.argsort(named)
        starts, named = find_runs(named[order])
        start = np.searchsorted(named, np.uint64(first << 48))
        points, starts = points.take(order, axis=1), starts[start:]
        return cls(named[start:], *_span(points, points, starts))


def _span(low: Floats, high: Floats, starts: Ints) -> tuple[Floats, Floats]:
    if not len(starts):
        return low[:, :0], high[:, :0]
    return np.minimum.reduceat(low, starts, axis=1), np.maximum.reduceat(high, starts, axis=1)


def join_cells(cells: Sequence[SurfaceCells]) -> SurfaceCells:
    """Return the cells of one surface or more, every cell once, in the order of the keys."""
    keys = np.concatenate([one.keys for one in cells])
    low = np.concatenate([one.low for one in cells], axis=1)
    high = np.concatenate([one.high for one in cells], axis=1)
    order = np.argsort(keys, kind="stable")  # twice as fast, because much is in order
    starts, keys = find_runs(keys[order])
    return SurfaceCells(keys, *_span(low.take(order, axis=1), high.take(order, axis=1), starts))


def keep_largest_parts(cells: SurfaceCells) -> SurfaceCells:
    """Keep the cells of the largest part of every label: cells that touch are of one part."""
    from scipy.sparse import coo_array  # Imported here because importing SciPy is slow.
    from scipy.sparse.csgraph import connected_components

    keys = cells.keys
    if not len(keys):
        return cells
    one = np.uint64(1)
    starts = np.append(0, 1 + np.flatnonzero(np.diff(keys) != one))  # of cells one above another
    lengths = np.diff(starts, append=len(keys))
    lowest, highest = keys[starts], keys[starts + lengths - 1]
    rows, columns = [], []
    for step in _COLUMNS:
        stack, other = np.arange(len(starts)), np.searchsorted(highest, lowest + step - one)
        while len(stack):  # the first stack there that is not below, and those above that one
            met = lowest.take(other, mode="clip") <= highest[stack] + step + one
            met &= other < len(starts)
            stack, other = stack[met], other[met]
            rows.append(stack)
            columns.append(other)
            other = other + 1
    row, column = np.concatenate(rows), np.concatenate(columns)
    touching = coo_array((np.ones(len(row), bool), (row, column)), shape=(len(starts),) * 2)
    _, part = connected_components(touching, directed=False)
    size = np.bincount(part, lengths)[part]
    firsts, _ = find_runs(lowest >> np.uint64(48))
    stacks = np.diff(firsts, append=len(starts))
    most = np.repeat(np.maximum.reduceat(size, firsts), stacks)
    best = np.where(size == most, part, part.max() + 1)
    chosen = part == np.repeat(np.minimum.reduceat(best, firsts), stacks)  # ties: the first
    kept = np.repeat(chosen, lengths)
    return SurfaceCells(keys[kept], cells.low[:, kept], cells.high[:, kept])
