"""Align the predictions of any program with masked pairs, and score them like a model's.

Without p0, p1, … the likelihood is that of a zero-inflated Poisson with the stated presence and
expected count. As for all models, a rate below 0.001 counts as 0.001. With them, the remaining
probability is spread geometrically over the counts above the last one, so that the mean is the
expected count if possible. A probability below 1e-6 counts as 1e-6.

Nodes that were wholly seen may be left out, and so may the buildings (node 0). A missing building
follows from its rooms.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import pandas as pd

from bsg_data.arrays import Bools, Floats
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_models.belief.count_distribution import MIN_RATE, zero_inflated
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import PredictionError
from bsg_models.evaluation.prediction_files import KEYS, NODE, Predictions

_LEAST = 1e-6  # one log 0 would dominate any mean
_LISTED = 5


@dataclass(frozen=True, eq=False)
class _PredictedExpectation(Expectation):
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
        stated = _log_of_table(counts, self.exactly, self.stated_hidden)
        return np.where(np.isnan(self.exactly[0]), inflated, stated)


def _log_of_table(counts: Floats, table: Floats, expected: Floats) -> Floats:
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
    """Predictions of all N measured nodes."""

    nodes: pd.MultiIndex  # `[N]` scene id, draw and index of the node in its building
    there: Bools  # `[N, C]` whether there is a row
    # column → `[N, C]`: presence, expected, and total if stated
    values: Mapping[str, Floats]
    exactly: Sequence[Floats]  # `[N, C]` of p0, p1, …
    buildings: bool  # whether building nodes have rows

    def expect(self, masked: MaskedBuildings) -> _PredictedExpectation:
        """Return the predictions of some masked buildings; missing buildings follow from rooms."""
        seen, rows = masked.seen, self.nodes.get_indexer(_index_nodes(masked))
        values = {name: column[rows] for name, column in self.values.items()}
        presence, hidden, inputs = values["presence"], values["expected"], seen.inputs.astype(float)
        if not self.buildings:
            rooms, own = ~seen.is_building, seen.building
            sums = np.zeros((len(seen), hidden.shape[1]))
            np.add.at(sums, own[rooms], hidden[rooms])
            none = np.ones_like(sums)
            np.multiply.at(none, own[rooms], 1 - presence[rooms])
            hidden[seen.is_building], presence[seen.is_building] = sums, 1 - none
        totals = whole = inputs + hidden
        if "total" in values:  # it is 0 in cells without a row
            left = seen.is_building & (not self.buildings) | ~_hides(masked)
            totals = np.where(left[:, None], whole, values["total"])
        told = [np.where(self.there[rows], chance[rows], np.nan) for chance in self.exactly]
        return _PredictedExpectation(
            inputs,
            zero_inflated(presence, hidden),
            totals,
            stated_presence=presence,
            stated_hidden=hidden,
            exactly=np.stack(told) if told else None,
        )


def align(
    predictions: Predictions,
    batches: Iterable[MaskedBuildings],
    classes: Sequence[str],
    *,
    elsewhere: Collection[str] = (),
) -> AlignedPredictions:
    """Align predictions with the masked buildings that are measured.

    Args:
        predictions: rows in any order.
        batches: all measured masked buildings.
        classes: `[C]` names.
        elsewhere: scenes of other folds, whose rows are skipped.
    """
    parts = [(_index_nodes(some), _hides(some), some.seen.is_building) for some in batches]
    indices, hides, is_building = zip(*parts, strict=True)
    nodes = indices[0].append(list(indices[1:]))
    rows = predictions.rows[~predictions.rows["scene_id"].isin(elsewhere)]
    place = nodes.get_indexer(pd.MultiIndex.from_frame(rows[list(NODE)]))
    label = pd.Index(classes).get_indexer(pd.Index(rows["class"]))
    cells = place * len(classes) + label
    _require(rows, place >= 0, "node", "is of no node that is measured here")
    _require(rows, label >= 0, "class", "is of a class that the class space does not have")
    twice = pd.Series(cells).duplicated().to_numpy()
    _require(rows, ~twice, "twice", "is there twice; expected one row of each")

    def fill(column: object) -> Floats:
        filled = np.zeros(there.shape)
        filled.flat[cells] = column
        return filled

    there = np.zeros((len(nodes), len(classes)), dtype=bool)
    there.flat[cells] = True
    buildings = bool((rows["node_index"] == 0).any())
    needed = np.concatenate(hides) & (buildings | ~np.concatenate(is_building))
    _require_all(predictions, nodes, classes, needed[:, None] & ~there)
    return AlignedPredictions(
        nodes,
        there,
        {name: fill(rows[name]) for name in ("presence", "expected", "total") if name in rows},
        [fill(rows[name]) for name in predictions.exactly],
        buildings,
    )


def _index_nodes(masked: MaskedBuildings) -> pd.MultiIndex:
    sizes = np.diff(masked.seen.starts)
    scenes = np.array(masked.seen.scene_ids, dtype=object)
    return pd.MultiIndex.from_arrays(
        [scenes.repeat(sizes), masked.draws.repeat(sizes), masked.nodes], names=NODE
    )


def _hides(masked: MaskedBuildings) -> Bools:
    return np.asarray((masked.seen.cell_share > 0).any(axis=1))


def _require(rows: pd.DataFrame, sound: Bools, what: str, why: str) -> None:
    if sound.all():
        return
    wrong = int(np.argmin(sound))
    file, number = rows.index[wrong]
    scene, draw, node, label = rows.iloc[wrong][list(KEYS)]
    raise PredictionError(
        f"{file}: row {number} (scene {scene!r}, draw {draw}, node {node}, class {label!r}): "
        f"{why}; found {int((~sound).sum()):,} such",
        code=f"prediction-{what}",
        where=f"{file}: row {number}",
    )


def _require_all(
    predictions: Predictions, nodes: pd.MultiIndex, classes: Sequence[str], missing: Bools
) -> None:
    """Refuse predictions without a row of a node that hides something."""
    if not missing.any():
        return
    listed = [
        "scene {}, draw {}, node {}, class {}".format(*nodes[node], classes[label])
        for node, label in np.argwhere(missing)[:_LISTED].tolist()
    ]
    number = int(missing.sum())
    raise PredictionError(
        f"{predictions.path}: {number:,} rows are missing: "
        f"{'; '.join(listed)}{'; …' if number > _LISTED else ''}",
        code="prediction-missing",
        where=predictions.path,
    )
