"""Surfaces as triangles, the stretches that they form, and the cells of a grid that they lie in."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats, Ints, find_runs

Labels = npt.NDArray[np.uint16]
Keys = npt.NDArray[np.uint64]  # label and cell: 16 bits each of label, x, y and z
Corners = npt.NDArray[np.float32]  # [3, 3, T] of triangles, as axis and corner
Values = npt.NDArray[np.complex64]  # one per corner or piece

BLOCK = 2**14
CELL = 0.1  # metres; triangles are of one part if their middles lie in cells that touch
_LAST = np.uint64(0xFFFF)  # the bits of an axis
_MOST_CUTS = 512  # of a side of a triangle
_MIDDLE = 2**15  # the number of the cell at 0
# To half of the eight lines of cells beside one, as differences of keys.
_STEPS = tuple(np.uint64(x * 2**32 + y * 2**16) for x, y in ((0, 1), (1, -1), (1, 0), (1, 1)))


@dataclass(frozen=True, slots=True)
class Triangles:
    """Triangles, with one row per axis: sums of rows are faster."""

    corners: Corners
    low: npt.NDArray[np.float32]  # [3, T] the lowest corner of the box around each
    high: npt.NDArray[np.float32]  # [3, T] the highest

    @classmethod
    def of_corners(cls, corners: Corners) -> Triangles:
        """Return triangles with the boxes around them."""
        a, b, c = corners.transpose(1, 0, 2)
        low, high = np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)
        return cls(corners, low, high)

    def measure(self) -> tuple[npt.NDArray[np.float32], npt.NDArray[np.float32]]:
        """Return the area `[T]` and the middle `[3, T]` of each."""
        a, b, c = self.corners.transpose(1, 0, 2)
        (ux, uy, uz), (vx, vy, vz) = b - a, c - a
        x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
        return np.sqrt(x * x + y * y + z * z) / 2, (a + b + c) / 3

    def cut_long(self, values: Values) -> Iterator[tuple[Triangles, Values]]:
        """Cut what is longer than a cell into pieces of at most half a cell.

        Yields:
            some pieces, and in their middles the mean `[S]` of the values `[3, T]` at the corners.
        """
        square = ((self.high - self.low) ** 2).sum(axis=0)
        is_long = square > CELL**2
        if not is_long.any():
            yield self, (values[0] + values[1] + values[2]) / 3
            return
        cuts = np.where(is_long, np.ceil(np.sqrt(square) / (CELL / 2)), 1).clip(max=_MOST_CUTS)
        cuts = np.where(cuts > 16, np.ceil(cuts / 8) * 8, cuts).astype(np.int64)  # few groups
        for n in np.unique(cuts):
            weights = cut_triangle(int(n)).astype(np.float32)
            whole = np.flatnonzero(cuts == n)
            step = max(1, BLOCK // len(weights))
            for start in range(0, len(whole), step):
                some = whole[start : start + step]
                pieces = np.tensordot(self.corners[:, :, some], weights, axes=(1, 2))
                corners = pieces.transpose(0, 3, 1, 2).reshape(3, 3, -1)
                means = np.tensordot(values[:, some], weights.mean(axis=1), axes=(0, 1))
                yield Triangles.of_corners(corners), means.ravel()


@dataclass(frozen=True, slots=True)
class Surface:
    """Stretches of triangles, each of one label and in cells that touch, and all these cells."""

    starts: Keys  # [S] the first cell of every stretch
    low: Floats  # [3, S] its lowest corner
    high: Floats  # [3, S] its highest corner
    sums: Floats  # [4, S] its area, and area times x, y and z
    cells: Keys  # [P] ascending

    @classmethod
    def of_triangles(cls, triangles: Triangles, labels: Labels) -> Surface:
        """Return the surface of triangles, one or more, with the label `[T]` of each."""
        area, middles = triangles.measure()
        changes, keys = find_runs(_name(np.floor(middles / CELL), labels))
        starts = _find_starts(keys)
        first = changes[starts]
        moments = (np.add.reduceat(x, first, dtype=float) for x in (area, *area * middles))
        return cls(
            starts=keys[starts],
            low=np.minimum.reduceat(triangles.low, first, axis=1),
            high=np.maximum.reduceat(triangles.high, first, axis=1),
            sums=np.array([*moments]),
            cells=_sort(keys),
        )

    @classmethod
    def join(cls, several: Sequence[Surface]) -> Surface:
        """Return one surface of several, one or more, in the order of labels."""
        starts = np.concatenate([surface.starts for surface in several])
        order = np.argsort(starts >> np.uint64(48), kind="stable")
        low, high, sums = (
            np.concatenate([getattr(surface, name) for surface in several], axis=1)[:, order]
            for name in ("low", "high", "sums")
        )
        cells = _sort(np.concatenate([surface.cells for surface in several]))
        return cls(starts[order], low, high, sums, cells)

    def keep(self, stretches: Bools, cells: Bools) -> Surface:
        """Return some of the stretches and of the cells."""
        low, high, sums = (row[:, stretches] for row in (self.low, self.high, self.sums))
        return Surface(self.starts[stretches], low, high, sums, self.cells[cells])

    def measure(self, labels: int) -> tuple[Floats, Floats]:
        """Return the box of every label `[L, 2, 3]`, NaN without any, and its sums `[4, L]`."""
        boxes, sums = np.full((labels, 2, 3), np.nan), np.zeros((4, labels))
        starts, named = find_runs(find_labels(self.starts))
        if len(named):
            boxes[named, 0] = np.minimum.reduceat(self.low, starts, axis=1).T
            boxes[named, 1] = np.maximum.reduceat(self.high, starts, axis=1).T
            sums[:, named] = np.add.reduceat(self.sums, starts, axis=1)
        return boxes, sums

    def largest_parts(self, *, first: int) -> Surface:
        """Return the largest part of every label from `first` up: what lies in touching cells."""
        part = _find_parts(self.cells)
        size = np.bincount(part)[part]
        labels = find_labels(self.cells)
        order = np.lexsort((part, -size, labels))  # of equal ones the first
        best = np.full(labels.max() + 1, -1)
        runs, named = find_runs(labels[order])
        best[named] = part[order[runs]]
        is_best = (part == best[labels]) & (labels >= first)
        return self.keep(is_best[np.searchsorted(self.cells, self.starts)], is_best)


def _find_starts(cells: Keys) -> Ints:
    """Return where cells begin that do not touch the one before, or are of another label."""
    step = cells[1:] - cells[:-1] + np.uint64(2**32 + 2**16 + 1)  # every axis from 0 to 2
    x, y, z = step >> np.uint64(32), step >> np.uint64(16) & _LAST, step & _LAST
    return np.append(0, 1 + np.flatnonzero((x > 2) | (y > 2) | (z > 2)))


def _sort(cells: Keys) -> Keys:
    """Return cells in order, each once. Much is in order: `np.unique` takes ten times as long."""
    return find_runs(np.sort(cells, kind="stable"))[1]


def _name(cells: npt.NDArray[np.float32], labels: Labels) -> Keys:
    x, y, z = cells.astype(np.int64) + _MIDDLE
    places = (x << 32) + (y << 16) + z
    keys: Keys = places.view(np.uint64) | labels.astype(np.uint64) << np.uint64(48)
    return keys


def find_labels(keys: Keys) -> Ints:
    """Return the label of every cell `[P]`."""
    return (keys >> np.uint64(48)).astype(np.int64)


def find_corners(cells: Keys) -> Floats:
    """Return the lowest corner of every cell `[P, 3]`."""
    axes = np.stack([cells >> np.uint64(shift) & _LAST for shift in (32, 16, 0)], axis=1)
    return (axes.astype(np.float64) - _MIDDLE) * CELL


def cut_triangle(n: int) -> Floats:
    """Return the n² triangles of one whose sides are cut into n: weights `[n², 3, 3]`.

    The rows of a triangle are its corners, as sums of the corners of the whole.
    """
    i, j = np.indices((n, n)).reshape(2, -1)
    first = np.array([[i, j], [i + 1, j], [i, j + 1]])[:, :, i + j < n]
    second = np.array([[i + 1, j + 1], [i, j + 1], [i + 1, j]])[:, :, i + j < n - 1]
    u, v = np.concatenate([first, second], axis=2).transpose(1, 2, 0) / n
    return np.stack([1 - u - v, u, v], axis=2)


def _find_parts(cells: Keys) -> Ints:
    """Return the number of the part that every cell `[P]` is of: cells of a label that touch."""
    from scipy.sparse import coo_array  # Imported here because importing SciPy is slow.
    from scipy.sparse.csgraph import connected_components

    unit = np.uint64(1)
    starts = np.append(0, 1 + np.flatnonzero(np.diff(cells) != unit))  # of cells in line along z
    lengths = np.diff(starts, append=len(cells))
    lowest, highest = cells[starts], cells[starts + lengths - 1]
    rows, columns = [], []
    for step in _STEPS:
        line, other = np.arange(len(starts)), np.searchsorted(highest, lowest + step - unit)
        while len(line):  # the first line there that is not below, and those above that one
            touches = lowest.take(other, mode="clip") <= highest[line] + step + unit
            touches &= other < len(starts)
            line, other = line[touches], other[touches]
            rows.append(line)
            columns.append(other)
            other = other + 1
    row, column = np.concatenate(rows), np.concatenate(columns)
    touching = coo_array((np.ones(len(row), bool), (row, column)), shape=(len(starts),) * 2)
    return np.repeat(connected_components(touching, directed=False)[1], lengths)
