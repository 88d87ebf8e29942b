"""Parts: categories outside the classes that belong to an object of a class.

A curtain rod tells that there is a curtain. A mask that hides objects independently can show the
rod and hide the curtain. A real robot seldom sees one without the other.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import cache

import numpy as np

from bsg_data.arrays import Ints
from bsg_data.scene.class_space import read_published, read_rows

PARTS = "parts-v1.csv"


@cache
def load_parts() -> Mapping[str, str]:
    """Return category → class of the object that it is a part of.

    Raises:
        ClassMapError: if the file is not the published one.
    """
    return dict(row for _, row in read_rows(PARTS, read_published(PARTS), ("category", "class")))


def find_wholes(
    categories: Sequence[str], classes: Sequence[str], parts: Mapping[str, str]
) -> Ints:
    """Return the index of the class that each category is a part of, `[K]`; -1 for none.

    >>> find_wholes(["curtain rod", "wall"], ["bed", "curtain"], {"curtain rod": "curtain"})
    array([ 1, -1])
    """
    index = {name: number for number, name in enumerate(classes)}
    return np.array([index.get(parts.get(name, ""), -1) for name in categories], dtype=np.int64)
