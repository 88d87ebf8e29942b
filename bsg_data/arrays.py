"""Types of arrays; docstrings give shapes as `[N, C]`."""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt

Bools = npt.NDArray[np.bool_]
Counts = npt.NDArray[np.int64]
Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
_Integer = TypeVar("_Integer", bound=np.integer[Any])


def find_runs(values: npt.NDArray[_Integer]) -> tuple[Ints, npt.NDArray[_Integer]]:
    """Return where each run of equal values starts, and its value."""
    if not len(values):
        return np.zeros(0, dtype=np.int64), values
    starts = np.concatenate([[0], 1 + np.flatnonzero(values[1:] != values[:-1])])
    return starts, values[starts]
