"""Count the objects outside the classes by category.

They carry information: a shower dial says bathroom and a worktop says kitchen, though neither is a
class.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts

NO_CATEGORY = ""  # stands for nameless and unmapped objects: nothing to learn from


@dataclass(frozen=True, eq=False)
class OtherObjects:
    """The objects without a class of one scene."""

    # `[K]` names, sorted; `NO_CATEGORY` stands for objects without a category
    categories: tuple[str, ...]
    cells: Counts  # `[1 + R, K]` counts, row 0 the null region


def choose_vocabulary(others: Iterable[OtherObjects], *, min_scenes: int) -> tuple[str, ...]:
    """Return the sorted categories that occur in at least `min_scenes` of the scenes."""
    scenes = Counter(name for one in others for name in one.categories if name != NO_CATEGORY)
    return tuple(sorted(name for name, number in scenes.items() if number >= min_scenes))


def place_columns(categories: Sequence[str], vocabulary: Sequence[str]) -> npt.NDArray[np.int64]:
    """Return the column of the vocabulary of every category, -1 for one that is not in it.

    >>> place_columns(["tap", "zebra"], ["drawer", "tap"]).tolist()
    [1, -1]
    """
    number = {name: i for i, name in enumerate(vocabulary)}
    return np.array([number.get(name, -1) for name in categories], dtype=np.int64)
