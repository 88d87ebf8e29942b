"""Connections between rooms: which rooms connect, how that is known, and the distance."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

GIVEN = "given"  # the method of a connection that a robot reports


@dataclass(frozen=True, eq=False)
class Connections:
    """A connections between rooms, each stored once.

    Attributes:
        pairs: `[A, 2]` node indices, the lower first.
        methods: `[A]` how each is known: `layout`, `door`, `stairs`, `boxes`, `robot` or `given`.
        lengths: `[A]` metres between the centroids of the two rooms; NaN if unknown.
    """

    pairs: npt.NDArray[np.int64]
    methods: npt.NDArray[np.str_]
    lengths: npt.NDArray[np.float64]

    def __len__(self) -> int:
        """Return the number A of connections."""
        return len(self.pairs)

    @classmethod
    def of_pairs(cls, pairs: Iterable[tuple[int, int]]) -> Connections:
        """Return the connections that a robot gives, of unknown length."""
        array = np.array(list(pairs), dtype=np.int64).reshape(-1, 2)
        return cls(array, np.full(len(array), GIVEN), np.full(len(array), np.nan))

    def take(self, rows: npt.NDArray[np.integer] | npt.NDArray[np.bool_] | slice) -> Connections:
        """Return some of the connections."""
        return Connections(self.pairs[rows], self.methods[rows], self.lengths[rows])

    def among(self, nodes: npt.NDArray[np.int64]) -> Connections:
        """Return the connections between some nodes, whose indices rise, by their index there."""
        row_of = np.full(max(self.pairs.max(initial=0), nodes.max(initial=0)) + 1, -1)
        row_of[nodes] = np.arange(len(nodes))
        moved = row_of[self.pairs]
        is_among = (moved >= 0).all(axis=1)
        return Connections(moved[is_among], self.methods[is_among], self.lengths[is_among])


NO_CONNECTIONS = Connections.of_pairs(())


def stack_connections(several: Sequence[Connections], offsets: Sequence[int]) -> Connections:
    """Return the connections of several buildings, one or more, moved by the first node of each."""
    return Connections(
        np.concatenate(
            [connections.pairs + first for connections, first in zip(several, offsets, strict=True)]
        ),
        np.concatenate([connections.methods for connections in several]),
        np.concatenate([connections.lengths for connections in several]),
    )
