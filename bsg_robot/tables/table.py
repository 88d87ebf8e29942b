"""Read the tables of this folder, each checked by its hash."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from bsg_data.scene.class_space import read_columns, read_published

_FOLDER = "bsg_robot.tables"
_SEPARATOR = "|"  # between the names of a cell


@cache
def read_table(file: str) -> Mapping[str, tuple[str, ...]]:
    """Return the columns of a table by name; `ClassMapError` if it was changed."""
    return read_columns(file, folder=_FOLDER)


def read_file(file: str) -> bytes:
    """Return the bytes of a table; `ClassMapError` if it was changed."""
    return read_published(file, folder=_FOLDER)


def split_cell(cell: str) -> tuple[str, ...]:
    """Return the names of a cell `name|name`."""
    return tuple(cell.split(_SEPARATOR)) if cell else ()


def split_weights(cell: str, *, of: float = 1.0) -> tuple[tuple[str, float], ...]:
    """Return the names of a cell `name:weight|name:weight`, each with its part of a whole."""
    parts = [part.partition(":") for part in cell.split(_SEPARATOR)] if cell else []
    return tuple([(name, float(weight) / of) for name, _, weight in parts])
