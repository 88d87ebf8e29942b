"""Rank the (node, class) cells by presence, under the weights of all resamples at once.

Presence is P(at least one hidden object), in a room or anywhere in a building; rooms and buildings
are ranked separately. There are three selections of cells: `all`; those of classes that are
`unseen` in their node; and those of rooms that are `unvisited`, of which nothing was seen, or a
little through a door.

Cells are not sorted, but counted for each building and class in `BINS` bins of presence, equally
wide in log odds. A resample weights the counts. All cells of a bin tie, so in a bin with t hidden
and f other cells, T and F of them in all and t⁺ and f⁺ in higher bins,

- AUROC differs from that of the sorted cells by at most Σ t f / (2 T F),
- average precision by at most Σ t/T · ((t⁺ + t)/(t⁺ + f⁺ + t) − t⁺/(t⁺ + f⁺ + f)).

Both are 0 if no bin has different scores.
"""

from __future__ import annotations

from functools import cached_property
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
from scipy import sparse

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.arrays import accumulate
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.truth import Truth

SELECTIONS = ("all", "unseen", "unvisited")
RANKED = ("rooms", "building")  # node sets
UNDEFINED = ("building", "unvisited")  # a robot is in its building
BINS = 1 << 18
_REACH = 20.0  # presence beyond these log odds, 2e-9 and its complement, is in the outer bins
_COLUMNS, _CELLS = 32, 1 << 22  # weights at least, and cells, that are dense at a time
_Weights = npt.NDArray[Any]
_Counts = tuple[Ints, Bools, Ints, Ints]  # bin, hidden, building and number of some cells


class _Ranks(NamedTuple):
    """AUROC and average precision under W weights; nan if they are not defined.

    The first row is of all classes in one ranking, the others of each class ranked separately.
    """

    auroc: dict[str, Floats]  # selection → `[1 + C, W]`
    precision: dict[str, Floats]  # selection → `[1 + C, W]`


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


class PresenceHistograms:
    """How many cells of each building, class and selection lie in each bin, hidden and other."""

    def __init__(self, weights: _Weights) -> None:
        self.nodes = dict.fromkeys(SELECTIONS, 0)  # selection → number of nodes with such a cell
        self._weights = weights  # `[B, W]`
        self._classes = 1
        self._cells: list[tuple[Ints, Ints]] = []  # of each batch: distinct cells, their number

    def add(self, truth: Truth, expectation: Expectation, rows: Ints, building: Ints) -> None:
        """Add M nodes, by their rows, of the buildings `[M]` by number."""
        presence, seen = expectation.presence[rows], truth.inputs[rows] > 0
        self._classes = presence.shape[1]
        flags = (truth.hidden[rows] > 0).astype(np.int64)
        for number, (name, own) in enumerate(
            select_cells(seen, truth.visited[rows], truth.known[rows]).items(), 1
        ):
            self.nodes[name] += int(own.any(axis=1).sum())
            flags |= own.astype(np.int64) << number
        axes = (np.arange(self._classes), _bin_presence(presence), flags, building[:, None])
        cells = np.ravel_multi_index(np.broadcast_arrays(*axes), self._shape)
        self._cells.append(np.unique(cells, return_counts=True))

    @cached_property
    def ranks(self) -> _Ranks:
        """AUROC and average precision of all cells."""
        cells, counts = map(np.concatenate, zip(*self._cells, strict=True))
        own, which, flags, building = np.unravel_index(cells, self._shape)
        hidden = (flags & 1) > 0
        ranks = _Ranks({}, {})
        for number, name in enumerate(SELECTIONS, 1):
            there = (flags >> number & 1) > 0
            table = (which[there], hidden[there], building[there], counts[there])
            both = zip(
                _rank(table, self._weights, np.zeros_like(own[there]), groups=1),
                _rank(table, self._weights, own[there], groups=self._classes),
                strict=True,
            )
            ranks.auroc[name], ranks.precision[name] = map(np.concatenate, both)
        return ranks

    @property
    def _shape(self) -> tuple[int, ...]:
        return self._classes, BINS, 2 << len(SELECTIONS), len(self._weights)


def _rank_bins(true: Floats, tied: Floats, false: Floats) -> tuple[Floats, Floats]:
    """Return AUROC and average precision of histograms, both `[W]`; nan if not defined.

    Args:
        true: `[T, W]` weight of the hidden cells in each bin that has any, from the highest bin.
        tied: `[T, W]` weight of the others in these bins.
        false: `[T + 1, W]` weight of all others in each of these bins and in the bins above it up
            to the one before; the last row is of the bins below.
    """
    others, above = accumulate(np.add, false), accumulate(np.add, true.copy())
    ends = np.stack([above[-1] if len(above) else np.zeros(true.shape[1]), others[-1]])
    np.subtract(tied / 2, others[:-1], out=tied)
    area = np.einsum("tw,tw->w", true, tied) + ends.prod(axis=0)
    np.add(above, others[:-1], out=tied)
    precision = np.divide(above, tied, out=above, where=tied > 0)
    ranked = np.einsum("tw,tw->w", true, precision)
    unknown = np.full_like(ends[0], np.nan)
    both = ends.prod(axis=0)
    return (
        np.divide(area, both, out=unknown.copy(), where=both > 0),
        np.divide(ranked, ends[0], out=unknown, where=ends[0] > 0),
    )


def _rank(cells: _Counts, weights: _Weights, group: Ints, *, groups: int) -> tuple[Floats, Floats]:
    """Return AUROC and average precision of each group of cells under every weight, `[G, W]`."""
    bins, hidden, building, counts = cells
    keys = group * BINS + (BINS - 1 - bins)
    filled = np.unique(keys[hidden])  # only these bins add to either
    place, ends = (
        np.searchsorted(filled, keys),
        np.searchsorted(filled, BINS * np.arange(groups + 1)),
    )
    tied = ~hidden & np.isin(keys, filled)
    tables = [
        sparse.csr_array((counts[own], (rows[own], building[own])), shape=(number, len(weights)))
        for own, rows, number in (
            (hidden, place, len(filled)),
            (tied, place, len(filled)),
            (~hidden, place + group, len(filled) + groups),  # each group has a row for bins below
        )
    ]
    columns = max(_COLUMNS, _CELLS // (len(filled) + groups))
    pieces = []
    for some in np.split(weights, range(columns, weights.shape[1], columns), axis=1):
        true, alike, false = (table @ some.astype(float) for table in tables)
        pieces.append(
            [
                _rank_bins(true[a:b], alike[a:b], false[a + number : b + number + 1])
                for number, (a, b) in enumerate(pairwise(ends.tolist()))
            ]
        )
    auroc, precision = np.concatenate([np.array(one).swapaxes(0, 1) for one in pieces], axis=-1)
    return auroc, precision
