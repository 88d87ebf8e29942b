"""Align the predictions of any program with masked pairs, and score them like a model's.

Without p0, p1, … the likelihood is that of a zero-inflated Poisson with the stated presence and
expected count. As for all models, a rate below 0.001 counts as 0.001. With them, the remaining
probability is spread geometrically over the counts above the last one, so that the mean is the
expected count if possible. A probability below 1e-6 counts as 1e-6.

Nodes that were wholly seen may be left out, and so may the buildings (node 0). A missing building
follows from its rooms.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from tempfile import TemporaryFile
from typing import Literal
from weakref import finalize

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.count_distribution import MIN_RATE, zero_inflated
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError

PRESENCE, EXPECTED, TOTAL = "presence", "expected", "total"
_LEAST = 1e-6  # one log 0 would dominate any mean
_LISTED = 5
_EXACTLY = re.compile(r"p(?:0|[1-9][0-9]*)")


@dataclass(frozen=True, eq=False)
class PredictedExpectation(Expectation):
    """Predictions of a file for N nodes and C classes.

    `hidden_counts` is the distribution without p0, p1, ….

    Attributes:
        stated_presence: `[N, C]` as stated in the file.
        stated_hidden: `[N, C]` expected hidden counts as stated in the file.
        exactly: `[J + 1, N, C]` P(hidden = 0..J), nan where not stated; None without the columns.
    """

    stated_presence: Floats = field(kw_only=True)
    stated_hidden: Floats = field(kw_only=True)
    exactly: Floats | None = field(kw_only=True)

    @cached_property
    def presence(self) -> Floats:
        """P(at least one hidden object of the class), `[N, C]`."""
        return self.stated_presence

    @cached_property
    def hidden(self) -> Floats:
        """Expected number of hidden objects, λ ≥ 0, `[N, C]`."""
        return self.stated_hidden

    def log_probability(self, counts: Floats, *, floor: float = MIN_RATE) -> Floats:
        """Return log P(hidden = counts), `[N, C]`, from p0, p1, … where they are stated."""
        inflated = super().log_probability(counts, floor=floor)
        if self.exactly is None:
            return inflated
        stated = log_of_table(counts, self.exactly, self.stated_hidden)
        return np.where(np.isnan(self.exactly[0]), inflated, stated)


def log_of_table(counts: Floats, table: Floats, expected: Floats) -> Floats:
    """Return log P(counts) `[N, C]` from a table of probabilities with a geometric tail.

    With T = 1 − Σ p, P(J + 1 + i) = T (1 − q) qⁱ, i = 0, 1, …; q makes the mean the expected count,
    but is limited to 0..0.99.

    Args:
        counts: `[N, C]` whole numbers.
        table: `[J + 1, N, C]` P(0..J); nan gives nan.
        expected: `[N, C]` mean of the counts.
    """
    first = len(table)  # the smallest count of the tail
    mass = np.maximum(1 - table.sum(axis=0), 0.0)
    short = expected - np.tensordot(np.arange(first), table, axes=1)
    beyond = np.divide(short, mass, out=np.full_like(mass, first), where=mass > 0) - first
    q = np.clip(beyond / (1 + np.maximum(beyond, 0)), 0.0, 0.99)
    steps = np.maximum(counts - first, 0)
    tail = mass * (1 - q) * q**steps
    place = np.minimum(counts, first - 1).astype(np.int64)[None]
    found = np.where(counts < first, np.take_along_axis(table, place, axis=0)[0], tail)
    return np.asarray(np.log(np.maximum(found, _LEAST)))


@dataclass(frozen=True, eq=False)
class PredictedRows:
    """Some consecutive rows of predictions, before they are aligned with masks.

    Attributes:
        scenes: `[S]` names that occur.
        classes: `[K]` names of classes that occur.
        scene: `[R]` number of the scene of every row.
        label: `[R]` number of the class of every row.
        draw: `[R]`.
        node: `[R]`.
        values: column → `[R]`: presence, expected, p0, p1, …, and total if stated.
        place: file and number of the first row, for messages.
    """

    scenes: tuple[str, ...]
    classes: tuple[str, ...]
    scene: Ints
    label: Ints
    draw: Ints
    node: Ints
    values: dict[str, Floats]
    place: tuple[Path, int]

    def __len__(self) -> int:
        """Return the number of rows R."""
        return len(self.draw)

    def find(self, cells: PairCells, elsewhere: frozenset[str]) -> tuple[Ints, Ints]:
        """Return which rows belong to measured pairs, and the cell of each.

        Args:
            cells: of the pairs.
            elsewhere: scenes whose rows are skipped.

        Raises:
            PredictionError: if a row belongs to no cell.
        """
        passed = np.array([name in elsewhere for name in self.scenes], dtype=bool)
        kept = np.flatnonzero(~passed[self.scene]) if len(self.scene) else np.zeros(0, np.int64)
        scenes = np.array([cells.scenes.get(name, -1) for name in self.scenes], dtype=np.int64)
        labels = np.array([cells.classes.get(name, -1) for name in self.classes], dtype=np.int64)
        scene, label = scenes[self.scene[kept]], labels[self.label[kept]]
        self._require(kept, scene >= 0, "is of a scene that is not measured here")
        self._require(kept, label >= 0, "is of a class that the class space does not have")
        pair = cells.find_pairs(scene, self.draw[kept])
        self._require(kept, pair >= 0, f"expected a draw of {cells.listed_draws}")
        node = self.node[kept]
        sizes = np.diff(cells.starts)[pair]
        self._require(kept, (node >= 0) & (node < sizes), "its building has no such node")
        return kept, (cells.starts[pair] + node) * len(cells.classes) + label

    def _require(self, kept: Ints, sound: Bools, why: str) -> None:
        if not sound.all():
            wrong = int(kept[np.argmin(sound)])
            raise PredictionError(f"{self.say(wrong)}: {why}; found {int((~sound).sum()):,} such")

    def say(self, row: int) -> str:
        """Return the name of a row, for messages."""
        file, start = self.place
        return (
            f"{file}: row {start + row} (scene {self.scenes[self.scene[row]]!r}, draw "
            f"{self.draw[row]}, node {self.node[row]}, class {self.classes[self.label[row]]!r})"
        )


class PairCells:
    """The (node, class) cells of stored pairs, by scene, draw and node.

    Attributes:
        scenes: scene id → its number.
        classes: name → its number.
        starts: `[P + 1]` first node of each of the P masked buildings.
        listed_draws: for messages.
    """

    def __init__(self, batches: Iterable[MaskedBuildings], classes: Sequence[str]) -> None:
        names: list[str] = []
        draws, sizes, hides, buildings = [], [], [], []
        for masked in batches:
            names += masked.seen.scene_ids
            draws.append(masked.draws)
            sizes.append(np.diff(masked.seen.starts))
            hides.append((masked.seen.cell_share > 0).any(axis=1))
            buildings.append(masked.seen.is_building)
        self.classes = {name: number for number, name in enumerate(classes)}
        self.scenes = {name: i for i, name in enumerate(dict.fromkeys(names))}
        self.starts = np.concatenate([[0], np.cumsum(np.concatenate(sizes))])
        self._names, self._draws = names, np.concatenate(draws)
        self._hides, self._is_building = np.concatenate(hides), np.concatenate(buildings)
        self.listed_draws = f"{self._draws.min()}..{self._draws.max()}"
        self._pair = np.full((len(self.scenes), int(self._draws.max()) + 1), -1, dtype=np.int64)
        self._pair[[self.scenes[name] for name in names], self._draws] = np.arange(len(names))

    def __len__(self) -> int:
        """Return the number of cells."""
        return len(self._hides) * len(self.classes)

    def find_pairs(self, scene: Ints, draw: Ints) -> Ints:
        """Return the number of the masked building of each scene and draw; -1 if unknown."""
        known = (draw >= 0) & (draw < self._pair.shape[1])
        return np.where(known, self._pair[scene, np.where(known, draw, 0)], -1)

    def rows_of(self, masked: MaskedBuildings) -> list[slice]:
        """Return the nodes of some masked buildings, in their order."""
        scene = np.array([self.scenes[name] for name in masked.seen.scene_ids], dtype=np.int64)
        pairs = self.find_pairs(scene, masked.draws)
        return [slice(int(self.starts[k]), int(self.starts[k + 1])) for k in pairs]

    def require_all(self, there: Bools, *, buildings: bool, path: Path) -> None:
        """Check that every node that hides something has its rows.

        Args:
            there: `[cells]` whether there is a row.
            buildings: whether building nodes need rows, too.
            path: for the message.

        Raises:
            PredictionError: if a row is missing.
        """
        nodes = self._hides & (buildings | ~self._is_building)
        there = there.reshape(-1, len(self.classes))
        missing = np.argwhere(nodes[:, None] & ~there)
        if len(missing):
            listed = "; ".join(self._describe(*cell) for cell in missing[:_LISTED].tolist())
            raise PredictionError(
                f"{path}: {len(missing):,} of {int(nodes.sum()) * len(self.classes):,} rows are "
                f"missing: {listed}{'; …' if len(missing) > _LISTED else ''}"
            )

    def _describe(self, node: int, label: int) -> str:
        pair = int(np.searchsorted(self.starts, node, side="right")) - 1
        return (
            f"scene {self._names[pair]}, draw {self._draws[pair]}, node "
            f"{node - int(self.starts[pair])}, class {list(self.classes)[label]}"
        )


class LaidPredictions:
    """The predictions of every cell, in a temporary file, because rows come in any order.

    Args:
        cells: of the measured pairs.
        columns: names of the predicted values.
        path: for messages.
    """

    def __init__(self, cells: PairCells, columns: Sequence[str], *, path: Path) -> None:
        self._cells, self._columns, self._path = cells, tuple(columns), path
        self._there = np.zeros(len(cells), dtype=bool)
        self._buildings = False
        self._file = TemporaryFile()  # noqa: SIM115 closed with this object
        finalize(self, self._file.close)
        self._file.truncate(max(len(cells) * len(columns) * 8, 1))

    def add(self, rows: PredictedRows, *, elsewhere: frozenset[str]) -> None:
        """Add some rows.

        Args:
            rows: of any cells.
            elsewhere: scenes whose rows are skipped.

        Raises:
            PredictionError: if a row is unknown or repeated.
        """
        kept, flat = rows.find(self._cells, elsewhere)
        twice = np.ones(len(flat), dtype=bool)
        twice[np.unique(flat, return_index=True)[1]] = False
        twice |= self._there[flat]
        if twice.any():
            second = rows.say(int(kept[np.argmax(twice)]))
            raise PredictionError(f"{second}: is there twice; expected one row of each")
        self._there[flat] = True
        self._buildings |= bool((rows.node[kept] == 0).any())
        table = self._map("r+")
        for number, name in enumerate(self._columns):
            table[number, flat] = rows.values[name][kept]

    def finish(self) -> None:
        """Check that no row is missing.

        Raises:
            PredictionError: if one is.
        """
        self._cells.require_all(self._there, buildings=self._buildings, path=self._path)

    def expect(self, masked: MaskedBuildings) -> PredictedExpectation:
        """Return the predictions of some masked buildings."""
        table = self._map("r").reshape(len(self._columns), -1, len(self._cells.classes))
        slices = self._cells.rows_of(masked)
        whole = np.concatenate([table[:, rows] for rows in slices], axis=1)
        there = self._there.reshape(table.shape[1:])
        known = np.concatenate([there[rows] for rows in slices])
        values = dict(zip(self._columns, whole, strict=True))
        exactly = [values.pop(name) for name in self._columns if is_exactly(name)]
        told = [np.where(known, chance, np.nan) for chance in exactly]
        return _expect(masked, values, told, buildings=self._buildings)

    def _map(self, mode: Literal["r", "r+"]) -> npt.NDArray[np.float64]:
        """Map the file again: parts that are no longer mapped take no memory."""
        shape = (len(self._columns), len(self._cells))
        return np.memmap(self._file, dtype=np.float64, mode=mode, shape=shape)


def is_exactly(column: str) -> bool:
    """Return whether a column is one of p0, p1, …."""
    return _EXACTLY.fullmatch(column) is not None


def _expect(
    masked: MaskedBuildings,
    values: dict[str, Floats],
    exactly: Sequence[Floats],
    *,
    buildings: bool,
) -> PredictedExpectation:
    """Return the prediction of every node; missing buildings follow from their rooms."""
    seen = masked.seen
    presence, hidden = values[PRESENCE], values[EXPECTED]
    inputs = seen.inputs.astype(float)
    totals = values.get(TOTAL)
    if not buildings:
        rooms, own = ~seen.is_building, seen.building
        sums = np.zeros((len(seen), hidden.shape[1]))
        np.add.at(sums, own[rooms], hidden[rooms])
        none = np.ones_like(sums)
        np.multiply.at(none, own[rooms], 1 - presence[rooms])
        hidden[seen.is_building], presence[seen.is_building] = sums, 1 - none
    # TOTAL is 0 in cells without a row.
    left = seen.is_building & (not buildings) | ~(seen.cell_share > 0).any(axis=1)
    whole = inputs + hidden
    return PredictedExpectation(
        inputs,
        zero_inflated(presence, hidden),
        whole if totals is None else np.where(left[:, None], whole, totals),
        stated_presence=presence,
        stated_hidden=hidden,
        exactly=np.stack(exactly) if exactly else None,
    )
