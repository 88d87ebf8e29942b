"""Checks of geometry that rooms and objects share."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.checks.part import Rows

ROUNDING = 2e-4  # metres: coordinates are rounded, and so are values derived from them
WHOLES = (("centroid",), ("box_min", "box_max"), ("part_min", "part_max"))  # all or nothing


def are_partial(*points: Floats) -> Bools:
    """Say for every row whether some, but not all, coordinates of its points `[n, 3]` are null."""
    null = np.isnan(np.concatenate(points, axis=1))
    number = null.sum(axis=1)
    return np.asarray((number > 0) & (number < null.shape[1]))


def read_points(rows: Rows, *wholes: tuple[str, ...]) -> dict[str, Floats]:
    """Return points `[n, 3]` by their names."""
    return {name: rows.points(name) for whole in wholes for name in whole}
