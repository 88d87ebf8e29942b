"""The files of a user's own class map, to be kept in datasets and checkpoints.

A published map comes with the package. A user's own map is only on the user's disk, so datasets and
checkpoints keep a copy of its files.
"""

from __future__ import annotations

from pathlib import Path

from bsg_data.errors import ClassMapError
from bsg_data.files import write_bytes
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import CLASS_MAP
from bsg_data.recipes import Record

SUFFIX, CLASSES, STRUCTURE = ".csv", ".classes.csv", ".structure.csv"


class OwnMap(Record):
    """The bytes of a user's own class map.

    Attributes:
        name: name of the map: the name of its file without `.csv`.
        spellings: `NAME.csv`.
        classes: `NAME.classes.csv`; None for a map into the default class space.
        structure: `NAME.structure.csv`; None without it.
    """

    name: str
    spellings: bytes
    classes: bytes | None = None
    structure: bytes | None = None


def is_own_map(name: str) -> bool:
    """Say whether the name of a class map is the path of a `NAME.csv`.

    >>> is_own_map("maps/mine.csv"), is_own_map("hm3d45-v2")
    (True, False)
    """
    return name.casefold().endswith(SUFFIX)


def read_own_map(path: Path) -> OwnMap:
    """Read the files of a class map, by the path of its `NAME.csv`.

    Raises:
        ClassMapError: if it is missing, cannot be read, or is too large for a class map.
    """
    if not path.is_file():
        raise ClassMapError(
            f"{path}: no such file; expected a class map NAME.csv (raw_category,category,class), "
            "and NAME.classes.csv (index,class,definition) beside it for its own classes"
        )
    return OwnMap(
        name=path.stem,
        spellings=_read(path),
        classes=_read_beside(path, CLASSES),
        structure=_read_beside(path, STRUCTURE),
    )


def write_own_map(own: OwnMap, folder: Path) -> Path:
    """Write the files of a class map into a folder, and return the path of its `NAME.csv`."""
    beside = {CLASSES: own.classes, STRUCTURE: own.structure}
    for suffix, data in {SUFFIX: own.spellings, **beside}.items():
        if data is not None:
            write_bytes(folder / f"{own.name}{suffix}", data)
    return folder / f"{own.name}{SUFFIX}"


def _read_beside(path: Path, suffix: str) -> bytes | None:
    beside = path.with_suffix(suffix)
    return _read(beside) if beside.is_file() else None


def _read(path: Path) -> bytes:
    return read_bytes(path, CLASS_MAP, error=ClassMapError)
