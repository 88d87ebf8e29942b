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
from bsg_models.evaluation.prediction_files import KEYS, NODE, Predictions, refuse_row

_LEAST = 1e-6  # one log 0 would dominate any mean


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
    """Predictions for each of N masked nodes, in the order of their batches."""

    nodes: pd.MultiIndex  # `[N]` scene, draw and node
    columns: Mapping[str, Floats]  # name → `[N, C]`; nan in cells without a row
    exactly: Sequence[str]  # names of p0, p1, …
    buildings: bool  # whether building nodes have rows

    def expect(self, masked: MaskedBuildings) -> _PredictedExpectation:
        """Return the predictions of some masked buildings; missing buildings follow from rooms."""
        seen, rows = masked.seen, self.nodes.get_indexer(_index_nodes(masked))
        columns = {name: values[rows] for name, values in self.columns.items()}
        presence, hidden = (np.nan_to_num(columns[name]) for name in ("presence", "expected"))
        if not self.buildings:
            rooms, own = ~seen.is_building, seen.building
            sums = np.zeros((len(seen), hidden.shape[1]))
            np.add.at(sums, own[rooms], hidden[rooms])
            none = np.ones_like(sums)
            np.multiply.at(none, own[rooms], 1 - presence[rooms])
            hidden[seen.is_building], presence[seen.is_building] = sums, 1 - none
        inputs = seen.inputs.astype(float)
        totals = columns.get("total", np.full_like(inputs, np.nan))
        is_whole = np.isnan(totals) | ~_hides(masked)[:, None]
        return _PredictedExpectation(
            inputs,
            zero_inflated(presence, hidden),
            np.where(is_whole, inputs + hidden, totals),
            stated_presence=presence,
            stated_hidden=hidden,
            exactly=np.stack([columns[p] for p in self.exactly]) if self.exactly else None,
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

    Raises:
        PredictionError: naming the first row that is of no measured node and class, or a second of
            one, or the first node and class without a row.
    """
    parts = [(_index_nodes(some), _hides(some), some.seen.is_building) for some in batches]
    indices, hides, is_building = zip(*parts, strict=True)
    nodes = indices[0].append(list(indices[1:]))
    cells = nodes.to_frame(index=False).merge(pd.DataFrame({"class": classes}), how="cross")
    rows = predictions.rows[~predictions.rows["scene_id"].isin(elsewhere)]
    rows = rows.astype({"scene_id": object, "class": object})
    refuse_row(
        rows, rows.duplicated(list(KEYS)).to_numpy(), expected="one row of each node and class"
    )
    known = rows[list(KEYS)].merge(cells, how="left", on=list(KEYS), indicator="of")["of"] == "both"
    refuse_row(
        rows, ~known.to_numpy(), expected="a node that is measured here, and a class of these"
    )
    merged = cells.merge(rows, how="left", on=list(KEYS), validate="1:1")
    buildings = bool((rows["node_index"] == 0).any())
    needed = np.concatenate(hides) & (buildings | ~np.concatenate(is_building))
    _require_all(predictions, merged, needed.repeat(len(classes)))
    columns = merged.columns[len(KEYS) :]
    shape = len(nodes), len(classes)
    return AlignedPredictions(
        nodes,
        {name: merged[name].to_numpy().reshape(shape) for name in columns},
        predictions.exactly,
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


def _require_all(predictions: Predictions, merged: pd.DataFrame, needed: Bools) -> None:
    """Refuse predictions without a row of a node that hides something."""
    missing = merged[needed & merged["presence"].isna().to_numpy()]
    if len(missing):
        listed = "scene {}, draw {}, node {}, class {}".format(*missing.iloc[0][list(KEYS)])
        raise PredictionError(
            f"{predictions.path}: expected a row of every node that hides something and every "
            f"class; {len(missing):,} are missing, first {listed}",
            code="prediction-missing",
            where=predictions.path,
        )
