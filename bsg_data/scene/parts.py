"""Parts of things: categories outside the classes that belong to a thing of a class.

A curtain rod says that there is a curtain. A mask that hides each object by itself shows the rod
while it hides the curtain; a robot that did not see the one seldom saw the other.
"""

from __future__ import annotations

import csv
import io
from collections.abc import Mapping, Sequence
from functools import lru_cache
from importlib.resources import files
from pathlib import Path
from types import MappingProxyType

import numpy as np

from bsg_data.arrays import Ints
from bsg_data.errors import ClassMapError

PARTS = "parts-v1.csv"
MAX_BYTES = 4 * 2**20
_HEADER = ["category", "class"]


@lru_cache(maxsize=4)
def load_parts(path: Path | None = None) -> Mapping[str, str]:
    """Return the class of the thing that each category is a part of.

    Args:
        path: a file of your own, `category,class`; None for the published one.

    Raises:
        ClassMapError: naming the file, the line and what was expected there.
    """
    where = path or files("bsg_mappings") / PARTS
    name = str(path or PARTS)
    try:
        data = where.read_bytes()
    except OSError as error:
        raise ClassMapError(f"{name}: cannot be read ({error.strerror})") from error
    if len(data) > MAX_BYTES:
        raise ClassMapError(f"{name}: more than {MAX_BYTES:,} bytes; expected category,class")
    try:
        rows = list(csv.reader(io.StringIO(data.decode("utf-8-sig"), newline=""), strict=True))
    except (UnicodeDecodeError, csv.Error) as error:
        raise ClassMapError(f"{name}: expected a CSV file in UTF-8 ({error})") from error
    if not rows or rows[0] != _HEADER:
        found = ",".join(rows[0]) if rows else "nothing"
        raise ClassMapError(f"{name}, line 1: expected category,class, found {found!r}")
    wholes: dict[str, str] = {}
    for line, row in enumerate(rows[1:], 2):
        if len(row) != len(_HEADER) or not all(row):
            raise ClassMapError(
                f"{name}, line {line}: expected a category and a class, found {row}"
            )
        if row[0] in wholes:
            raise ClassMapError(f"{name}, line {line}: {row[0]!r} is listed twice")
        wholes[row[0]] = row[1]
    return MappingProxyType(wholes)


def find_wholes(
    categories: Sequence[str], classes: Sequence[str], parts: Mapping[str, str]
) -> Ints:
    """Return the class that each category is a part of, by index, `[K]`; -1 for none of these.

    >>> find_wholes(["curtain rod", "wall"], ["bed", "curtain"], {"curtain rod": "curtain"})
    array([ 1, -1])
    """
    index = {name: number for number, name in enumerate(classes)}
    return np.array([index.get(parts.get(name, ""), -1) for name in categories], dtype=np.int64)
