"""Rank the (room, class) cells of any number of rooms by their presence.

A ranking needs all cells at once. They are stored with nine bytes each, in memory up to `HELD`
bytes and in a temporary file beyond. They are ranked class by class, then all classes together, one
range of scores at a time. Memory holds one class, some 50 bytes per room. The result is exact.
"""

from __future__ import annotations

from collections.abc import Iterator
from functools import cached_property
from itertools import pairwise
from tempfile import SpooledTemporaryFile
from typing import NamedTuple, TypeVar
from weakref import finalize

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.evaluation.presence import SELECTIONS, select_cells
from bsg_models.evaluation.rank_sweep import HIDDEN, Flags, RankSweep
from bsg_models.evaluation.streams import Batch, SharedCells, Weights

HELD = 1 << 26  # bytes kept in memory, of each of two files
PIECE = 1 << 21  # cells ranked at a time
_SAMPLED = 64  # one of this many scores is kept, to choose the ranges

_Number = TypeVar("_Number", bound=np.generic)


class Ranks(NamedTuple):
    """AUROC and average precision under W weights; nan if they are not defined.

    Attributes:
        auroc: selection → `[W]`, all classes in one ranking.
        precision: selection → `[W]`, all classes in one ranking.
        auroc_of_classes: selection → `[C, W]`, each class ranked separately.
        precision_of_classes: selection → `[C, W]`, each class ranked separately.
    """

    auroc: dict[str, Floats]
    precision: dict[str, Floats]
    auroc_of_classes: dict[str, Floats]
    precision_of_classes: dict[str, Floats]


class _Column(NamedTuple):
    """The cells of one class, or of all: score, flags and building, each `[M]`."""

    scores: Floats
    flags: Flags
    building: npt.NDArray[np.int32]

    def take(self, rows: Ints) -> _Column:
        return _Column(self.scores[rows], self.flags[rows], self.building[rows])

    def sorted(self) -> _Column:
        return self.take(np.argsort(-self.scores, kind="stable"))


class RankedCells(SharedCells):
    """The cells of rooms; `ranks` ranks them once all are added.

    Attributes:
        rooms: selection → number of rooms with such a cell.

    Args:
        weights: `[B, W]` how often each building counts.
    """

    def __init__(self, weights: Weights) -> None:
        self.rooms = dict.fromkeys(SELECTIONS, 0)
        self._weights = weights
        self._classes = 0
        self._buildings: list[npt.NDArray[np.int32]] = []  # of the rooms of each block
        self._samples: list[Floats] = []
        self._blocks = SpooledTemporaryFile(max_size=HELD)  # noqa: SIM115 closed with this object
        finalize(self, self._blocks.close)

    def add(self, batch: Batch) -> None:
        """Add the rooms of some nodes."""
        truth, rooms = batch.prediction.truth, batch.prediction.rows["rooms"]
        self.add_nodes(
            presence=batch.prediction.expectation.presence[rooms],
            seen=truth.inputs[rooms] > 0,
            hidden=truth.hidden[rooms] > 0,
            visited=truth.visited[rooms],
            building=batch.building[rooms],
        )

    def add_nodes(
        self, *, presence: Floats, seen: Bools, hidden: Bools, visited: Bools, building: Ints
    ) -> None:
        """Add some nodes.

        Args:
            presence: `[M, C]` P(at least one hidden object).
            seen: `[M, C]` whether an object was seen.
            hidden: `[M, C]` whether an object is hidden.
            visited: `[M]`.
            building: `[M]` row of the weights.
        """
        self._classes = presence.shape[1]
        if not len(presence):
            return
        flags = HIDDEN * hidden.astype(np.uint8)
        for number, (name, own) in enumerate(select_cells(seen, visited).items(), 1):
            self.rooms[name] += int(own.any(axis=1).sum())
            flags |= own.astype(np.uint8) << number
        self._samples.append(presence.ravel()[::_SAMPLED].copy())
        self._buildings.append(building.astype(np.int32))
        self._blocks.write(np.ascontiguousarray(presence.T, dtype=np.float64).tobytes())
        self._blocks.write(np.ascontiguousarray(flags.T).tobytes())

    @cached_property
    def ranks(self) -> Ranks:
        """AUROC and average precision of all cells; the cells are then released."""
        shape = (len(SELECTIONS), max(self._classes, 1), self._weights.shape[1])
        auroc, precision = np.full(shape, np.nan), np.full(shape, np.nan)
        building = np.concatenate(self._buildings or [np.zeros(0, dtype=np.int32)])
        whole = RankSweep(len(SELECTIONS), self._weights)
        with self._blocks, SpooledTemporaryFile(max_size=HELD) as ranked:
            columns = _SortedColumns(ranked, len(building))
            for c in range(self._classes):
                column = self._read_class(c, building).sorted()
                columns.append(column)
                sweep = RankSweep(len(SELECTIONS), self._weights)
                sweep.add(*column)
                auroc[:, c], precision[:, c] = sweep.finish()
            for piece in columns.merge(np.concatenate(self._samples or [np.zeros(0)])):
                whole.add(*piece)
        return Ranks(
            *(dict(zip(SELECTIONS, values, strict=True)) for values in whole.finish()),
            *(dict(zip(SELECTIONS, values, strict=True)) for values in (auroc, precision)),
        )

    def _read_class(self, number: int, building: npt.NDArray[np.int32]) -> _Column:
        """Return the cells of a class, in the order in which they were added."""
        scores, flags, start = [], [], 0
        for rooms in map(len, self._buildings):
            whole = rooms * self._classes
            scores.append(_read(self._blocks, start + 8 * rooms * number, rooms, np.float64))
            flags.append(_read(self._blocks, start + 8 * whole + rooms * number, rooms, np.uint8))
            start += 9 * whole
        return _Column(np.concatenate(scores), np.concatenate(flags), building)


class _SortedColumns:
    """The cells of each class by falling score, in a file; M cells per class."""

    def __init__(self, file: SpooledTemporaryFile[bytes], cells: int) -> None:
        self._file, self._cells = file, cells
        self._number = 0

    def append(self, column: _Column) -> None:
        """Append a class to the file."""
        for values in column:
            self._file.write(values.tobytes())
        self._number += 1

    def merge(self, samples: Floats) -> Iterator[_Column]:
        """Yield the cells of all classes by falling score, about `PIECE` at a time.

        Args:
            samples: some of the scores, from which the ranges are chosen.
        """
        if not self._number:
            return
        ends = _choose_ends(samples, self._number * self._cells)
        places = np.stack([self._find(c, ends) for c in range(self._number)])
        for first, last in pairwise(range(places.shape[1])):
            some = [self._slice(c, *places[c, [first, last]]) for c in range(self._number)]
            if first % 2:  # the cells of one score, possibly very many
                yield from (column for column in some if len(column.scores))
            else:
                yield _Column(*map(np.concatenate, zip(*some, strict=True))).sorted()

    def _find(self, number: int, ends: Floats) -> Ints:
        """Return the bounds of the ranges of scores in a class: above, at and below the ends."""
        rising = -self._slice(number, 0, self._cells).scores
        above = np.searchsorted(rising, -ends, side="left")
        through = np.searchsorted(rising, -ends, side="right")
        inner = np.column_stack([above, through]).ravel()
        return np.concatenate([[0], inner, [self._cells]]).astype(np.int64)

    def _slice(self, number: int, start: int, stop: int) -> _Column:
        begin, cells = number * 13 * self._cells, stop - start
        return _Column(
            _read(self._file, begin + 8 * start, cells, np.float64),
            _read(self._file, begin + 8 * self._cells + start, cells, np.uint8),
            _read(self._file, begin + 9 * self._cells + 4 * start, cells, np.int32),
        )


def _choose_ends(samples: Floats, cells: int) -> Floats:
    """Return falling scores with about `PIECE` cells between neighbours."""
    pieces = -(-cells // PIECE)
    if pieces < 2:
        return np.zeros(0)
    levels = np.arange(1, pieces) / pieces
    return np.unique(np.quantile(samples, levels, method="nearest"))[::-1]


def _read(
    file: SpooledTemporaryFile[bytes], start: int, number: int, kind: type[_Number]
) -> npt.NDArray[_Number]:
    """Return some numbers of a file, from a byte on."""
    file.seek(int(start))
    return np.frombuffer(file.read(int(number) * np.dtype(kind).itemsize), dtype=kind)
