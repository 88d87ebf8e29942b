"""What arrays of NumPy and tensors of torch are asked alike: models answer and train by one code.

Torch is never imported here: who has a tensor has it.
"""

from __future__ import annotations

import sys
from typing import Any

import numpy as np

Array = Any  # of NumPy or of torch


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
