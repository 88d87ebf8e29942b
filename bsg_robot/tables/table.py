"""Read the tables of this folder, each checked by its hash."""

from __future__ import annotations

from bsg_data.scene.class_space import read_published, read_rows

_FOLDER = "bsg_robot.tables"


def read_table(file: str, header: tuple[str, ...]) -> list[list[str]]:
    """Return the rows of a table; `ClassMapError` if it was changed or has other columns."""
    return [row for _, row in read_rows(file, read_file(file), header)]


def read_file(file: str) -> bytes:
    """Return the bytes of a table; `ClassMapError` if it was changed."""
    return read_published(file, folder=_FOLDER)
