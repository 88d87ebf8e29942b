"""What is checked of places alike in rooms and objects."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.checks.part import Rows

ROUNDING = 2e-4  # metres: coordinates are rounded, and what is derived from them again
WHOLES = (("centroid",), ("box_min", "box_max"), ("part_min", "part_max"))  # all or nothing


def are_partial(*points: Floats) -> Bools:
    """Say of every row whether some coordinates of its points `[n, 3]` are null, and not all."""
    null = np.isnan(np.concatenate(points, axis=1))
    number = null.sum(axis=1)
    return np.asarray((number > 0) & (number < null.shape[1]))


def read_points(rows: Rows, *wholes: tuple[str, ...]) -> dict[str, Floats]:
    """Return points `[n, 3]` by their names."""
    return {name: rows.points(name) for whole in wholes for name in whole}
