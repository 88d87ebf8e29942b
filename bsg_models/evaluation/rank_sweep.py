"""Compute AUROC and average precision for many weights in one pass over cells by falling score.

A weight is a resample of the buildings, of which there are hundreds. With one sort and one pass, a
cell costs one addition per weight. The result is exact, because the sums count buildings.
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats, Ints
from bsg_models.compilation import compiled
from bsg_models.evaluation.streams import Weights

Flags = npt.NDArray[np.uint8]
HIDDEN = 1  # bit of a cell that holds a hidden object; bit 1 + s means selection s has the cell
# Rows of a selection's sums, `[7, W]`: weight of the hidden and of the other cells above; weight of
# the others since the last hidden one; both weights in the open run of equal scores; sum, over the
# other cells, of the hidden weight above them; sum, over the hidden cells, of their precision.
_TRUE, _FALSE, _SINCE, _RUN_TRUE, _RUN_FALSE, _AREA, _PRECISION = range(7)


class RankSweep:
    """A pass over cells by falling score, which may come in pieces.

    Args:
        selections: number S of selections, each ranked separately.
        weights: `[B, W]` how often each building counts.
    """

    def __init__(self, selections: int, weights: Weights) -> None:
        self._weights = weights
        self._sums = np.zeros((selections, 7, weights.shape[1]))
        self._score = np.array([np.nan])  # score of the open run
        self._open = np.zeros(selections, dtype=np.bool_)  # whether a run is open

    def add(self, scores: Floats, flags: Flags, building: npt.NDArray[np.integer]) -> None:
        """Process some cells, none with a higher score than those before.

        Args:
            scores: `[M]` falling.
            flags: `[M]` bits: hidden, and which selections have the cell.
            building: `[M]` row of the weights.
        """
        _sweep(scores, flags, building, self._weights, self._sums, self._score, self._open)

    def finish(self) -> tuple[Floats, Floats]:
        """Return AUROC and average precision of each selection, both `[S, W]`; nan if undefined."""
        _close(self._sums, self._open)
        since = self._sums[:, _SINCE]
        self._sums[:, _AREA] += since * self._sums[:, _TRUE]
        self._sums[:, _FALSE] += since
        since[:] = 0
        true, false = self._sums[:, _TRUE], self._sums[:, _FALSE]
        both = true * false
        unknown = np.full_like(true, np.nan)
        auroc = np.divide(self._sums[:, _AREA], both, out=unknown.copy(), where=both > 0)
        return auroc, np.divide(self._sums[:, _PRECISION], true, out=unknown, where=true > 0)


@compiled(nogil=True)
def _sweep(
    scores: Floats,
    flags: Flags,
    building: Ints,
    weights: Weights,
    sums: Floats,
    score: Floats,
    is_open: Bools,
) -> None:
    """Process cells; `sums` is `[S, 7, W]`, `score` `[1]` and `is_open` `[S]` of the open run."""
    number, start = len(scores), 0
    while start < number:
        goes_on = scores[start] == score[0]
        if not goes_on:
            _close(sums, is_open)
            score[0] = scores[start]
        end = start + 1
        while end < number and scores[end] == score[0]:
            end += 1
        for s in range(len(sums)):
            own = 2 << s
            hidden = goes_on or end == number  # the end of a run in pieces is not known yet
            for i in range(start, end):
                if flags[i] & own and flags[i] & HIDDEN:
                    hidden = True
                    break
            is_open[s] = hidden
            for i in range(start, end):
                if flags[i] & own:
                    row = _SINCE
                    if hidden:
                        row = _RUN_TRUE if flags[i] & HIDDEN else _RUN_FALSE
                    b = building[i]
                    for w in range(sums.shape[2]):
                        sums[s, row, w] += weights[b, w]
        start = end


@compiled(nogil=True)
def _close(sums: Floats, is_open: Bools) -> None:
    """Close the open run of every selection: its cells tie, and ties count half."""
    for s in range(len(sums)):
        one = sums[s]
        if not is_open[s]:
            continue
        is_open[s] = False
        for w in range(one.shape[1]):
            since, true, false = one[_SINCE, w], one[_RUN_TRUE, w], one[_RUN_FALSE, w]
            above = one[_TRUE, w]
            one[_AREA, w] += since * above + false * (above + true / 2)
            one[_TRUE, w] += true
            one[_FALSE, w] += since + false
            whole = one[_TRUE, w] + one[_FALSE, w]
            if whole > 0:
                one[_PRECISION, w] += true * one[_TRUE, w] / whole
            one[_SINCE, w] = one[_RUN_TRUE, w] = one[_RUN_FALSE, w] = 0.0
