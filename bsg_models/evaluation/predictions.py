"""Align the predictions of any program with masked pairs, and score them like a model's.

Without p0, p1, … the likelihood is that of a zero-inflated Poisson with the stated presence and
expected count. As for all models, a rate below 0.001 counts as 0.001. With them, the remaining
probability is spread geometrically over the counts above the last one, so that the mean is the
expected count if possible. A probability below 1e-6 counts as 1e-6.

Nodes that were wholly seen may be left out, and so may the buildings (node 0). A missing building
follows from its rooms.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path

import numpy as np
import numpy.typing as npt
import pandas as pd

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.count_distribution import MIN_RATE, zero_inflated
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.prediction_files import (
    EXPECTED,
    KEYS,
    PRESENCE,
    TOTAL,
    Predictions,
    is_exactly,
)

_LEAST = 1e-6  # one log 0 would dominate any mean
_LISTED = 5


@dataclass(frozen=True, eq=False)
class PredictedExpectation(Expectation):
    """Predictions of a file for N nodes and C classes.

    `hidden_counts` is the distribution without p0, p1, ….
    """

    stated_presence: Floats = field(kw_only=True)  # `[N, C]` as stated in the file
    # `[N, C]` expected hidden counts as stated in the file
    stated_hidden: Floats = field(kw_only=True)
    # `[J + 1, N, C]` P(hidden = 0..J), nan where not stated; None without the columns
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
class AlignedPredictions:
    """Predictions of the N nodes of P masked buildings."""

    pairs: pd.MultiIndex  # `[P]` (scene id, draw)
    starts: Ints  # `[P + 1]` first node of each
    there: Bools  # `[N, C]` whether there is a row
    # column → `[N, C]`: presence, expected, p0, p1, …, and total if stated
    values: Mapping[str, Floats]
    buildings: bool  # whether building nodes have rows

    def expect(self, masked: MaskedBuildings) -> PredictedExpectation:
        """Return the predictions of some of the masked buildings."""
        pairs = self.pairs.get_indexer(pd.MultiIndex.from_arrays(_key_of(masked)))
        rows = np.concatenate([np.arange(*self.starts[[k, k + 1]]) for k in pairs])
        values = {name: column[rows] for name, column in self.values.items()}
        known = self.there[rows]
        exactly = [values.pop(name) for name in self.values if is_exactly(name)]
        told = [np.where(known, chance, np.nan) for chance in exactly]
        return _expect(masked, values, told, buildings=self.buildings)


def align(
    predictions: Predictions,
    batches: Iterable[MaskedBuildings],
    classes: Sequence[str],
    *,
    elsewhere: frozenset[str] = frozenset(),
) -> AlignedPredictions:
    """Align predictions with the masked buildings that are measured.

    Args:
        predictions: rows in any order.
        batches: all measured masked buildings.
        classes: `[C]` names.
        elsewhere: scenes of other folds, whose rows are skipped.
    """
    nodes = _MeasuredNodes.of(batches)
    rows = predictions.rows[~predictions.rows["scene_id"].isin(elsewhere)]
    cells = _find_cells(rows, nodes, classes)
    shape = (int(nodes.starts[-1]), len(classes))
    there = np.zeros(shape, dtype=bool)
    there.flat[cells] = True
    buildings = bool((rows["node_index"] == 0).any())
    _require_all(there, nodes, classes, buildings=buildings, path=predictions.path)
    values = {name: np.zeros(shape) for name in predictions.columns}
    for name, column in values.items():
        column.flat[cells] = rows[name].to_numpy()
    return AlignedPredictions(nodes.pairs, nodes.starts, there, values, buildings)


@dataclass(frozen=True, eq=False)
class _MeasuredNodes:
    """The nodes of all masked buildings; attributes as in `AlignedPredictions`."""

    pairs: pd.MultiIndex
    starts: Ints
    nodes: Ints  # `[N]` index of each in its building
    hides: Bools
    is_building: Bools

    @classmethod
    def of(cls, batches: Iterable[MaskedBuildings]) -> _MeasuredNodes:
        """Keep what tells the nodes apart, and whether they hide something."""
        parts = [
            (
                *_key_of(masked),
                np.diff(masked.seen.starts),
                masked.nodes,
                (masked.seen.cell_share > 0).any(axis=1),
                masked.seen.is_building,
            )
            for masked in batches
        ]
        scenes, draws, sizes, *columns = map(np.concatenate, zip(*parts, strict=True))
        starts = np.concatenate([[0], np.cumsum(sizes)])
        return cls(pd.MultiIndex.from_arrays([scenes, draws]), starts, *columns)

    def find(self, pairs: Ints, nodes: Ints) -> Ints:
        """Return the row of each pair's node; −1 where the pair has no such node."""
        size = int(self.nodes.max(initial=0)) + 1
        own = np.arange(len(self.pairs)).repeat(np.diff(self.starts)) * size + self.nodes
        asked = np.where((nodes >= 0) & (nodes < size), pairs * size + nodes, -1)
        return np.asarray(pd.Index(own).get_indexer(pd.Index(asked)))


def _key_of(masked: MaskedBuildings) -> tuple[npt.NDArray[np.object_], Ints]:
    return np.array(masked.seen.scene_ids, dtype=object), masked.draws


def _find_cells(rows: pd.DataFrame, nodes: _MeasuredNodes, classes: Sequence[str]) -> Ints:
    """Return the number of the (node, class) cell of each row."""
    label = pd.Index(classes).get_indexer(pd.Index(rows["class"]))
    pair = nodes.pairs.get_indexer(pd.MultiIndex.from_frame(rows[["scene_id", "draw"]]))
    _require(rows, rows["scene_id"].isin(nodes.pairs.levels[0]), "scene")
    _require(rows, label >= 0, "class")
    _require(rows, pair >= 0, "draw")
    row = nodes.find(pair, rows["node_index"].to_numpy())
    _require(rows, row >= 0, "node")
    cells = row * len(classes) + label
    _require(rows, ~pd.Series(cells).duplicated(), "twice")
    return np.asarray(cells)


_WHY = {
    "scene": "is of a scene that is not measured here",
    "class": "is of a class that the class space does not have",
    "draw": "is of a draw that the pairs do not have",
    "node": "its masked building has no such node",
    "twice": "is there twice; expected one row of each",
}


def _require(rows: pd.DataFrame, sound: Bools | pd.Series[bool], what: str) -> None:
    if sound.all():
        return
    wrong = int(np.argmin(sound))
    file, number = rows.index[wrong]
    scene, draw, node, label = rows.iloc[wrong][list(KEYS)]
    raise PredictionError(
        f"{file}: row {number} (scene {scene!r}, draw {draw}, node {node}, class {label!r}): "
        f"{_WHY[what]}; found {int((~sound).sum()):,} such",
        code=f"prediction-{what}",
        where=f"{file}: row {number}",
    )


def _require_all(
    there: Bools, nodes: _MeasuredNodes, classes: Sequence[str], *, buildings: bool, path: Path
) -> None:
    """Refuse predictions without a row of a node that hides something."""
    needed = nodes.hides & (buildings | ~nodes.is_building)
    missing = np.argwhere(needed[:, None] & ~there)
    if not len(missing):
        return
    listed = []
    for node, label in missing[:_LISTED].tolist():
        pair = int(np.searchsorted(nodes.starts, node, side="right")) - 1
        scene, draw = nodes.pairs[pair]
        place = f"scene {scene}, draw {draw}, node {nodes.nodes[node]}"
        listed.append(f"{place}, class {classes[label]}")
    raise PredictionError(
        f"{path}: {len(missing):,} of {int(needed.sum()) * len(classes):,} rows are missing: "
        f"{'; '.join(listed)}{'; …' if len(missing) > _LISTED else ''}",
        code="prediction-missing",
        where=path,
    )


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
