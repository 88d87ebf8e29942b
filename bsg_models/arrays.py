"""What arrays of NumPy and tensors of torch are asked alike: models answer and train by one code.

Torch is never imported here: who has a tensor has it.
"""

from __future__ import annotations

import sys
from itertools import pairwise
from typing import Any

import numpy as np
import numpy.typing as npt

Array = Any  # of NumPy or of torch
_SHORT = 64  # numbers of a row


def library_of(values: Any) -> Any:
    """Return the library of an array, whose functions have the same names in both."""
    return sys.modules["torch"] if type(values).__module__.startswith("torch") else np


def floats(values: Array) -> Array:
    """Return values in single precision."""
    return values.astype(np.float32) if isinstance(values, np.ndarray) else values.float()


def doubles(values: Array) -> Array:
    """Return values in double precision."""
    return values.astype(np.float64) if isinstance(values, np.ndarray) else values.double()


def add_rows(sums: Array, rows: Array, values: Array) -> Array:
    """Return sums `[B, W]` to which values `[N, W]` are added, each in its row `[N]`."""
    if not isinstance(values, np.ndarray):
        return sums.index_add(0, rows, values)
    np.add.at(sums, rows, values)
    return sums


def take_columns(values: npt.NDArray[Any], columns: npt.NDArray[np.integer]) -> npt.NDArray[Any]:
    """Return some columns `[M, A]` of `[..., M, C]`, where either may be 1 for all."""
    rows = np.arange(values.shape[-2])[:, None]
    taken: npt.NDArray[Any] = values[..., rows, columns if values.shape[-1] > 1 else 0]
    return taken


def accumulate(combine: np.ufunc, rows: npt.NDArray[Any]) -> npt.NDArray[Any]:
    """Combine each row with all before it, in place; NumPy's own way is slow for long rows."""
    if len(rows) and rows[0].size < _SHORT:
        return combine.accumulate(rows, out=rows)
    for before, row in pairwise(rows):
        combine(row, before, out=row)
    return rows
