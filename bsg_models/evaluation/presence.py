"""Score the (node, class) cells by presence, under the weights of all resamples at once.

Presence is P(at least one hidden object), in a room or anywhere in a building; rooms and buildings
are ranked separately. There are three selections of cells: `all`; those of classes that are
`unseen` in their node; and those of rooms that are `unvisited`, of which nothing was seen, or a
little through a door.

To rank cells, they are not sorted, but counted for each building and class in `BINS` bins of
presence, equally wide in log odds. A resample weights the counts. All cells of a bin tie, so in a
bin with t hidden and f other cells, T and F of them in all and t⁺ and f⁺ in higher bins,

- AUROC differs from that of the sorted cells by at most Σ t f / (2 T F),
- average precision by at most Σ t/T · ((t⁺ + t)/(t⁺ + f⁺ + t) − t⁺/(t⁺ + f⁺ + f)).

Both are 0 if no bin has different scores.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from scipy import sparse

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.evaluation.metric import RANKED, SELECTIONS, Value, Values, Weights, sum_weighted
from bsg_models.evaluation.metrics import mean_known
from bsg_models.evaluation.truth import Prediction

BINS = 1 << 18
CALIBRATION_BINS = 15  # of equal width
_REACH = 20.0  # presence beyond these log odds, 2e-9 and its complement, is in the outer bins
_COLUMNS, _CELLS = 32, 1 << 22  # weights at least, and cells, that are dense at a time
_Counts = tuple[Ints, Bools, Ints, Ints]  # bin, hidden, building and number of some cells


class Ranks(NamedTuple):
    """AUROC and average precision under W weights; nan if they are not defined.

    The first row is of all classes in one ranking, the others of each class ranked separately.
    """

    auroc: Floats  # `[1 + C, W]`
    precision: Floats  # `[1 + C, W]`


def select_cells(seen: Bools, visited: Bools, known: Bools | bool = True) -> dict[str, Bools]:
    """Return the cells of each selection `[N, C]`, of those whose truth is `known` `[N, C]`.

    They follow from which classes were `seen` `[N, C]`, and which rooms were `visited` `[N]`.
    """
    every = np.ones_like(seen) & known
    return dict(zip(SELECTIONS, (every, every & ~seen, every & ~visited[:, None]), strict=True))


def _bin_presence(presence: Floats) -> Ints:
    """Return the bin of each probability, 0..`BINS` - 1; a higher one has no lower bin."""
    with np.errstate(divide="ignore"):
        odds = np.log(presence) - np.log1p(-presence)
    return np.asarray(np.clip((odds / _REACH + 1) * (BINS / 2), 0, BINS - 1)).astype(np.int64)


class PresenceScores:
    """Ranking, squared errors and calibration of the cells of rooms, and of buildings."""

    def __init__(self, weights: Weights) -> None:
        self._weights = weights
        self._cells = {node_set: PresenceHistograms(weights) for node_set in RANKED}
        sums = np.zeros((weights.shape[1], 2 + CALIBRATION_BINS))
        # number of cells, squared errors, and gaps in bins of presence
        self._errors = {(n, part): sums.copy() for n in RANKED for part in SELECTIONS}

    def add(self, prediction: Prediction, building: Ints) -> None:
        """Add the cells of some nodes, of the buildings `[N]` by number."""
        truth = prediction.truth
        for node_set, cells in self._cells.items():
            rows = prediction.rows[node_set]
            cells.add(prediction, rows, building[rows])
            presence = prediction.expectation.presence[rows]
            gaps = presence - (truth.hidden[rows] > 0)
            seen = truth.inputs[rows] > 0
            for part, own in select_cells(seen, truth.visited[rows], truth.known[rows]).items():
                sums = np.c_[own.sum(axis=1), (own * gaps**2).sum(axis=1)]
                sums = np.c_[sums, _bin_gaps(presence, own * gaps)]
                self._errors[node_set, part] += sum_weighted(self._weights, building[rows], sums)

    def finish(self) -> Values:
        """Return all values."""
        return {
            (metric, node_set, part): Value(value, self._cells[node_set].nodes[part])
            for node_set, part in self._errors
            for metric, value in self._score(node_set, part).items()
        }

    def _score(self, node_set: str, part: str) -> dict[str, Floats]:
        ranks, errors = self._cells[node_set].rank(part), self._errors[node_set, part]
        number = errors[:, :1]
        means = np.divide(errors, number, out=np.full_like(errors, np.nan), where=number > 0)
        return {
            "presence_auroc_micro": ranks.auroc[0],
            "presence_ap_micro": ranks.precision[0],
            "presence_auroc_macro": mean_known(ranks.auroc[1:]),
            "presence_ap_macro": mean_known(ranks.precision[1:]),
            "presence_brier": means[:, 1],
            "presence_calibration_error": np.abs(means[:, 2:]).sum(axis=1),
        }


def _bin_gaps(presence: Floats, gaps: Floats) -> Floats:
    """Return the sums of the gaps `[N, C]` of each node in bins of presence, `[N, bins]`."""
    bins = CALIBRATION_BINS
    which = np.minimum((presence * bins).astype(np.int64), bins - 1)
    place = np.arange(len(which))[:, None] * bins + which
    sums = np.bincount(place.ravel(), gaps.ravel(), len(which) * bins)
    return np.asarray(sums.reshape(-1, bins), dtype=float)


class PresenceHistograms:
    """How many cells of each building, class and selection lie in each bin, hidden and other."""

    def __init__(self, weights: Weights) -> None:
        self.nodes = dict.fromkeys(SELECTIONS, 0)  # selection → number of nodes with such a cell
        self._weights = weights
        self._classes = 1
        self._cells: list[tuple[Ints, Ints]] = []  # of each batch: distinct cells, their number

    def add(self, prediction: Prediction, rows: Ints, building: Ints) -> None:
        """Add M nodes, by their rows, of the buildings `[M]` by number."""
        truth, presence = prediction.truth, prediction.expectation.presence[rows]
        self._classes = presence.shape[1]
        flags = (truth.hidden[rows] > 0).astype(np.int64)
        cells = select_cells(truth.inputs[rows] > 0, truth.visited[rows], truth.known[rows])
        for number, (part, own) in enumerate(cells.items(), 1):
            self.nodes[part] += int(own.any(axis=1).sum())
            flags |= own.astype(np.int64) << number
        axes = (np.arange(self._classes), _bin_presence(presence), flags, building[:, None])
        places = np.ravel_multi_index(np.broadcast_arrays(*axes), self._shape)
        self._cells.append(np.unique(places, return_counts=True))

    def rank(self, part: str) -> Ranks:
        """Return AUROC and average precision of the cells of a selection."""
        places, counts = map(np.concatenate, zip(*self._cells, strict=True))
        own, which, flags, building = np.unravel_index(places, self._shape)
        some = (flags >> 1 + SELECTIONS.index(part) & 1) > 0
        table = (which[some], (flags[some] & 1) > 0, building[some], counts[some])
        return _rank(table, self._weights, own[some], classes=self._classes)

    @property
    def _shape(self) -> tuple[int, ...]:
        return self._classes, BINS, 2 << len(SELECTIONS), len(self._weights)


def _rank(cells: _Counts, weights: Weights, own: Ints, *, classes: int) -> Ranks:
    """Return the ranks of all cells, and of those of each class, `own` class by class."""
    bins, building, counts = (np.tile(column, 2) for column in (cells[0], *cells[2:]))
    hidden = np.tile(cells[1], 2)
    group, groups = np.concatenate([np.zeros_like(own), 1 + own]), 1 + classes
    keys = group * BINS + (BINS - 1 - bins)
    filled = np.unique(keys[hidden])  # only these bins add to either
    place = np.searchsorted(filled, keys)
    ends = np.searchsorted(filled, BINS * np.arange(groups + 1))

    def count(some: Bools, rows: Ints, number: int) -> sparse.csr_array:
        shape = number, len(weights)
        return sparse.csr_array((counts[some], (rows[some], building[some])), shape=shape)

    true = count(hidden, place, len(filled))
    tied = count(~hidden & np.isin(keys, filled), place, len(filled))
    # Each group has a row for the bins below.
    false = count(~hidden, place + group, len(filled) + groups)
    columns = max(_COLUMNS, _CELLS // (len(filled) + groups))
    pieces = []
    for piece in np.split(weights, range(columns, weights.shape[1], columns), axis=1):
        some = piece.astype(float)
        pieces.append(_rank_bins(true @ some, tied @ some, false @ some, ends))
    return Ranks(*(np.concatenate(parts, axis=1) for parts in zip(*pieces, strict=True)))


def _rank_bins(true: Floats, tied: Floats, false: Floats, ends: Ints) -> tuple[Floats, Floats]:
    """Return AUROC and average precision of histograms, both `[G, W]`; nan if not defined.

    Sums of whole numbers are exact, so that the sum of a group is a difference of running sums.

    Args:
        true: `[T, W]` weight of the hidden cells in each bin that has any, group by group, from
            the highest bin.
        tied: `[T, W]` weight of the others in these bins.
        false: `[T + G, W]` weight of all others in each of these bins and in the bins above it up
            to the one before; the last row of each group is of the bins below.
        ends: `[G + 1]` where each group begins in `true`, and T.
    """
    groups, bins = len(ends) - 1, len(true)
    sum_groups = sparse.csr_array((np.ones(bins), np.arange(bins), ends), shape=(groups, bins))
    above, hidden = _run(true.copy(), ends)
    starts = ends + np.arange(groups + 1)
    others, unhidden = _run(false, starts)
    others = np.delete(others, starts[1:] - 1, axis=0)  # of the bins below
    pairs = hidden * unhidden
    area = sum_groups @ (true * (tied / 2 - others)) + pairs
    reached = above + others
    precision = np.divide(above, reached, out=above, where=reached > 0)
    nothing = np.full((groups, true.shape[1]), np.nan)
    return (
        np.divide(area, pairs, out=nothing.copy(), where=pairs > 0),
        np.divide(sum_groups @ (true * precision), hidden, out=nothing, where=hidden > 0),
    )


def _run(rows: Floats, starts: Ints) -> tuple[Floats, Floats]:
    """Return running sums within groups of rows, in place, and the sum of each group."""
    totals = np.zeros((len(starts), rows.shape[1]))
    running = np.cumsum(rows, axis=0, out=rows)
    totals[starts > 0] = running[starts[starts > 0] - 1]
    running -= np.repeat(totals[:-1], np.diff(starts), axis=0)
    return running, np.diff(totals, axis=0)
