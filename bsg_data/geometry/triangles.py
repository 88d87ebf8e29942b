"""Triangles as three arrays of corners, one row per axis, because sums of rows are faster."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Floats, Ints


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
