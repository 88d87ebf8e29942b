"""Find runs of equal values in an array."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Ints

Integer = TypeVar("Integer", bound=np.integer[Any])


def find_runs(values: npt.NDArray[Integer]) -> tuple[Ints, npt.NDArray[Integer]]:
    """Return where each run of equal values starts, and its value.

    >>> [part.tolist() for part in find_runs(np.array([7, 7, 2, 7]))]
    [[0, 2, 3], [7, 2, 7]]
    """
    if not len(values):
        return np.zeros(0, dtype=np.int64), values
    starts = np.concatenate([[0], 1 + np.flatnonzero(values[1:] != values[:-1])])
    return starts, values[starts]
