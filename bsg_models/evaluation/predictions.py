"""Predictions of any program, laid beside masked pairs: scored as a model's own beliefs are.

Without p0, p1, … the likelihood is that of a zero-inflated Poisson of presence and expected count,
with the floor of all models: a rate below 0.001 counts as 0.001. With them, what they leave of 1 is
spread geometrically over the counts above the last, so that the mean is the expected count if it
can be, and a probability below 1e-6 counts as 1e-6.

Nodes that were wholly seen may be left out, and so may the buildings (node 0): a building is then
what its rooms are together.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.count_distribution import MIN_RATE, zero_inflated
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError

PRESENCE, EXPECTED, TOTAL = "presence", "expected", "total"
_LEAST = 1e-6  # log 0 of one cell would swallow all the rest
_LISTED = 5


@dataclass(frozen=True, eq=False)
class PredictedExpectation(Expectation):
    """What a file says of N nodes and C classes; `hidden_counts` are those without p0, p1, ….

    Attributes:
        stated_presence: `[N, C]` as the file says it.
        stated_hidden: `[N, C]` expected hidden counts as the file says them.
        exactly: `[J + 1, N, C]` P(hidden = 0..J), nan where the file says nothing; None without.
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
        """Return log P(hidden = counts), `[N, C]`, by p0, p1, … where they are stated."""
        inflated = super().log_probability(counts, floor=floor)
        if self.exactly is None:
            return inflated
        stated = log_of_table(counts, self.exactly, self.stated_hidden)
        return np.where(np.isnan(self.exactly[0]), inflated, stated)


def log_of_table(counts: Floats, table: Floats, expected: Floats) -> Floats:
    """Return log P(counts) `[N, C]` by a table of probabilities with a geometric tail.

    With T = 1 − Σ p, P(J + 1 + i) = T (1 − q) qⁱ, i = 0, 1, …; q is such that the mean is the
    expected count, but from 0 to 0.99.

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
class Predictions:
    """The rows of a file, or of all files of a folder, before they are laid beside masks.

    Attributes:
        path: for messages.
        scenes: `[S]` names that occur.
        classes: `[K]` names of classes that occur.
        scene: `[R]` number of the scene of every row.
        label: `[R]` number of the class of every row.
        draw: `[R]`.
        node: `[R]`.
        values: column → `[R]`: presence, expected, and perhaps total.
        exactly: `[J + 1]` of `[R]`, p0, p1, …; empty without.
        files: with their numbers of rows, in order.
        masks: hashes of the masks that the files say they are of.
    """

    path: Path
    scenes: tuple[str, ...]
    classes: tuple[str, ...]
    scene: Ints
    label: Ints
    draw: Ints
    node: Ints
    values: dict[str, Floats]
    exactly: tuple[Floats, ...]
    files: tuple[tuple[Path, int], ...]
    masks: frozenset[str]

    def __len__(self) -> int:
        """Return the number of rows R."""
        return len(self.draw)

    def lay(
        self,
        masked: MaskedBuildings,
        classes: Sequence[str],
        *,
        elsewhere: frozenset[str] = frozenset(),
    ) -> PredictedExpectation:
        """Return what is predicted of masked buildings.

        Args:
            masked: what is measured.
            classes: `[C]` names of the class space.
            elsewhere: scenes whose rows are passed over: those of other folds.

        Raises:
            PredictionError: if a row is unknown or double, or rows are missing.
        """
        cells = _Cells(masked, classes)
        kept, flat = self._find(cells, elsewhere)
        there = np.bincount(flat, minlength=cells.number)
        if (there > 1).any():
            second = kept[np.flatnonzero(flat == int(np.argmax(there > 1)))[1]]
            raise PredictionError(f"{self._say(second)}: is there twice; expected one row of each")
        buildings = bool((self.node[kept] == 0).any())
        needed = cells.needed(buildings=buildings)
        missing = np.flatnonzero(needed & (there == 0))
        if len(missing):
            listed = "; ".join(cells.describe(cell) for cell in missing[:_LISTED])
            raise PredictionError(
                f"{self.path}: {len(missing):,} of {int(needed.sum()):,} rows are missing: {listed}"
                f"{'; …' if len(missing) > _LISTED else ''}"
            )
        values = {
            name: cells.spread(flat, column[kept], empty=0.0)
            for name, column in self.values.items()
        }
        exactly = [cells.spread(flat, column[kept], empty=np.nan) for column in self.exactly]
        return _expect(masked, values, exactly, buildings=buildings)

    def _find(self, cells: _Cells, elsewhere: frozenset[str]) -> tuple[Ints, Ints]:
        """Return which rows are kept, and the cell of each of them."""
        passed = np.array([name in elsewhere for name in self.scenes], dtype=bool)
        kept = np.flatnonzero(~passed[self.scene]) if len(self.scene) else np.zeros(0, np.int64)
        scenes = np.array([cells.scenes.get(name, -1) for name in self.scenes], dtype=np.int64)
        labels = np.array([cells.classes.get(name, -1) for name in self.classes], dtype=np.int64)
        scene, label = scenes[self.scene[kept]], labels[self.label[kept]]
        self._require(kept, scene >= 0, "is of a scene that is not measured here")
        self._require(kept, label >= 0, "is of a class that the class space does not have")
        first = cells.first(scene, self.draw[kept])
        self._require(kept, first >= 0, f"expected a draw of {cells.listed_draws}")
        sizes = cells.sizes(scene, self.draw[kept])
        node = self.node[kept]
        self._require(kept, (node >= 0) & (node < sizes), "its building has no such node")
        return kept, (first + node) * len(cells.classes) + label

    def _require(self, kept: Ints, sound: Bools, why: str) -> None:
        if not sound.all():
            wrong = int(kept[np.argmin(sound)])
            raise PredictionError(f"{self._say(wrong)}: {why}; found {int((~sound).sum()):,} such")

    def _say(self, row: int) -> str:
        file, place = find_row(self.files, row)
        return (
            f"{file}: row {place} (scene {self.scenes[self.scene[row]]!r}, draw "
            f"{self.draw[row]}, node {self.node[row]}, class {self.classes[self.label[row]]!r})"
        )


class _Cells:
    """The (node, class) cells of masked buildings, by scene, draw and node."""

    def __init__(self, masked: MaskedBuildings, classes: Sequence[str]) -> None:
        seen = masked.seen
        self._seen, self._names, self._draws = seen, tuple(classes), masked.draws
        self.classes = {name: number for number, name in enumerate(classes)}
        self.scenes = {name: i for i, name in enumerate(dict.fromkeys(seen.scene_ids))}
        self.number = len(seen.inputs) * len(classes)
        self.listed_draws = f"{masked.draws.min()}..{masked.draws.max()}"
        self._width = int(masked.draws.max()) + 1
        self._building = np.full((len(self.scenes), self._width), -1, dtype=np.int64)
        scene = [self.scenes[name] for name in seen.scene_ids]
        self._building[scene, masked.draws] = np.arange(len(seen))

    def first(self, scene: Ints, draw: Ints) -> Ints:
        """Return the row of the first node of a scene in a draw; -1 for an unknown draw."""
        building = self._of(scene, draw)
        return np.where(building >= 0, self._seen.starts[building], -1)

    def sizes(self, scene: Ints, draw: Ints) -> Ints:
        """Return how many nodes a building has."""
        return np.diff(self._seen.starts)[self._of(scene, draw)]

    def _of(self, scene: Ints, draw: Ints) -> Ints:
        known = (draw >= 0) & (draw < self._width)
        return np.where(known, self._building[scene, np.where(known, draw, 0)], -1)

    def needed(self, *, buildings: bool) -> Bools:
        """Return the cells of which a row is needed: of nodes that hide anything."""
        nodes = (self._seen.cell_share > 0).any(axis=1) & (buildings | ~self._seen.is_building)
        return np.repeat(nodes, len(self._names))

    def describe(self, cell: int) -> str:
        """Name a cell."""
        node, label = divmod(int(cell), len(self._names))
        building = int(self._seen.building[node])
        return (
            f"scene {self._seen.scene_ids[building]}, draw {self._draws[building]}, node "
            f"{node - int(self._seen.starts[building])}, class {self._names[label]}"
        )

    def spread(self, flat: Ints, column: Floats, *, empty: float) -> Floats:
        """Return a column as `[N, C]`."""
        found = np.full(self.number, empty)
        found[flat] = column
        return found.reshape(-1, len(self._names))


def find_row(files: Sequence[tuple[Path, int]], row: int) -> tuple[Path, int]:
    """Return the file of a row of several files, and its number there, from 0."""
    for file, rows in files:
        if row < rows:
            return file, row
        row -= rows
    raise IndexError(row)


def _expect(
    masked: MaskedBuildings,
    values: dict[str, Floats],
    exactly: Sequence[Floats],
    *,
    buildings: bool,
) -> PredictedExpectation:
    """Return what is predicted of every node; without buildings, they follow from their rooms."""
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
    # TOTAL is 0 where a row was left out.
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
