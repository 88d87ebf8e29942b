"""Histograms of classes at the nodes of interest (paper, section II: E × O).

Two arrays of the same shape `[N, C]`, N = 1 + R:

- *cells*: row 0 counts the objects of the null region, rows 1..R those of the rooms. Every object
  is in one cell, so masks are drawn on cells.
- *histograms*: row 0 counts the whole building, rows 1..R the rooms.

Objects outside the classes are counted by category. They carry information: a shower dial says
bathroom and a worktop says kitchen, though neither is a class.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts, Ints


def count_cells(
    room_index: npt.NDArray[np.integer], kind: npt.NDArray[np.integer], *, shape: tuple[int, int]
) -> Counts:
    """Count objects by room and kind.

    Args:
        room_index: `[O]` room 0..R of every object.
        kind: `[O]` kind 0..K-1 of every object, such as its class.
        shape: (1 + R, K).

    Returns:
        `[1 + R, K]` cells.
    """
    flat = room_index.astype(np.int64) * shape[1] + kind.astype(np.int64)
    return np.bincount(flat, minlength=shape[0] * shape[1]).reshape(shape)


def to_histograms(cells: Counts) -> Counts:
    """Return cells `[..., N, C]` as histograms: row 0 becomes the sum over all rows.

    Examples:
        >>> to_histograms(np.array([[1, 0], [2, 3]])).tolist()
        [[3, 3], [2, 3]]
    """
    histograms = cells.copy()
    histograms[..., 0, :] = cells.sum(axis=-2)
    return histograms


def stack_histograms(cells: Counts, starts: Ints) -> Counts:
    """Turn cells `[K, C]` of several buildings into histograms; `starts` has their first rows."""
    cells[starts] = np.add.reduceat(cells, starts, axis=0)
    return cells


NO_CATEGORY = ""  # stands for nameless and unmapped objects: nothing to learn from


@dataclass(frozen=True, eq=False)
class Unclassified:
    """The objects without a class of one scene of N nodes, counted by node and category.

    Attributes:
        names: categories, sorted, also of other scenes; `NO_CATEGORY` stands for objects without.
        nodes: N.
        rows: `[P]` node of each count, rising; row 0 is the null region.
        kinds: `[P]` category of each count, rising in a row.
        counts: `[P]` number of objects.
    """

    names: tuple[str, ...]
    nodes: int
    rows: Ints
    kinds: Ints
    counts: Counts

    @classmethod
    def of_cells(cls, categories: tuple[str, ...], cells: Counts) -> Unclassified:
        """Return the objects of cells `[N, K]`."""
        rows, kinds = np.nonzero(cells)
        return cls(categories, len(cells), rows, kinds, cells[rows, kinds])

    @property
    def categories(self) -> tuple[str, ...]:
        """The categories of the scene, `[K]`."""
        return tuple(self.names[kind] for kind in np.unique(self.kinds).tolist())

    @property
    def cells(self) -> Counts:
        """The counts of these categories as cells, `[N, K]`."""
        return self.count(self.categories)

    def cut(self, nodes: Ints) -> Unclassified:
        """Return the objects of some nodes, whose numbers rise from 0.

        Without all of them, those of the null region are left out.
        """
        if len(nodes) == self.nodes:
            return self
        row_of = np.full(self.nodes, -1)
        row_of[nodes[1:]] = np.arange(1, len(nodes))
        rows = row_of[self.rows]
        found = np.flatnonzero(rows >= 0)
        return Unclassified(
            self.names, len(nodes), rows[found], self.kinds[found], self.counts[found]
        )

    def count(self, vocabulary: tuple[str, ...]) -> Counts:
        """Return the objects in the columns of a vocabulary, `[N, V]` cells."""
        cells = np.zeros((self.nodes, len(vocabulary)), dtype=np.int64)
        found = _find_columns(self.names, vocabulary)[self.kinds]
        some = found >= 0
        cells[self.rows[some], found[some]] = self.counts[some]
        return cells


def choose_vocabulary(unclassified: Iterable[Unclassified], *, min_scenes: int) -> tuple[str, ...]:
    """Return the sorted categories that occur in at least `min_scenes` of the scenes."""
    scenes = Counter(
        name for scene in unclassified for name in scene.categories if name != NO_CATEGORY
    )
    return tuple(sorted(name for name, number in scenes.items() if number >= min_scenes))


def find_columns(categories: Sequence[str], vocabulary: Sequence[str]) -> npt.NDArray[np.int64]:
    """Return the column of the vocabulary of every category, -1 for one that is not in it.

    >>> find_columns(["tap", "zebra"], ["drawer", "tap"]).tolist()
    [1, -1]
    """
    number = {name: i for i, name in enumerate(vocabulary)}
    return np.array([number.get(name, -1) for name in categories], dtype=np.int64)


_find_columns = lru_cache(maxsize=4096)(find_columns)
