"""Keep what an evaluation shows besides metrics: errors of each class, and nodes for figures."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import pandas as pd

from bsg_data.arrays import Bools, Floats
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.metric import RANKED
from bsg_models.evaluation.presence import PresenceHistograms
from bsg_models.evaluation.truth import Prediction, Truth


@dataclass(frozen=True, eq=False)
class ShownNodes:
    """What is seen, expected and true of M nodes."""

    inputs: Floats  # `[M, C]` histograms that the masks leave
    totals: Floats  # `[M, C]` whole histograms as the model predicts them
    targets: Floats  # `[M, C]` true histograms
    is_building: Bools  # `[M]`
    example: int  # row of the node that is drawn separately


class Details:
    """Errors of one model by class, over the rooms and over the buildings, and nodes to show.

    Args:
        stride: number k such that every k-th masked building is shown; 0 for none.
        example: building that is shown in its first draw besides.
    """

    def __init__(self, stride: int = 0, example: str = "") -> None:
        once = np.ones((1, 1))
        self._cells = {name: PresenceHistograms(once) for name in RANKED}
        self._sums: dict[str, Floats] = {}
        self._nodes = dict.fromkeys(RANKED, 0)
        self._stride, self._example = stride, example
        self._masked = self._rows = 0
        self._found: int | None = None
        self._parts: list[tuple[Floats, Floats, Floats, Bools]] = []

    def add(self, prediction: Prediction) -> None:
        """Add some masked buildings; each begins with its building node."""
        truth, expectation = prediction.truth, prediction.expectation
        error = np.where(truth.known, expectation.totals - truth.targets, 0.0)
        for name in RANKED:
            rows = prediction.rows[name]
            some = error[rows]
            sums = np.stack([truth.targets[rows], some, np.abs(some)]).sum(axis=1)
            self._sums[name] = self._sums[name] + sums if name in self._sums else sums
            self._nodes[name] += len(rows)
            self._cells[name].add(prediction, rows, np.zeros(len(rows), dtype=np.int64))
        if self._stride:
            self._show(truth, expectation)

    def tabulate(self, model: str, classes: Sequence[str]) -> pd.DataFrame:
        """Return one row per node set and class: the paper's error in number O″ − O, presence."""
        frames = []
        for name in RANKED:
            count, error, absolute = self._sums[name] / max(self._nodes[name], 1)
            ranks = self._cells[name].rank("all")
            columns = {
                "model": model,
                "nodes": name,
                "class": classes,
                "count": count,
                "mean_error": error,
                "mean_absolute_error": absolute,
                "presence_auroc": ranks.auroc[1:, 0],
                "presence_ap": ranks.precision[1:, 0],
            }
            frames.append(pd.DataFrame(columns))
        return pd.concat(frames, ignore_index=True)

    def shown(self) -> ShownNodes:
        """Return the nodes to show."""
        inputs, totals, targets, is_building = map(np.concatenate, zip(*self._parts, strict=True))
        return ShownNodes(inputs, totals, targets, is_building, self._found or 0)

    def _show(self, truth: Truth, expectation: Expectation) -> None:
        place = self._masked + np.cumsum(truth.is_building) - 1
        self._masked += int(truth.is_building.sum())
        keep = place % self._stride == 0
        if self._found is None and self._example in truth.scene_ids:
            number = truth.scene_ids.index(self._example)
            first = int(np.flatnonzero(truth.is_building & (truth.building == number))[0])
            keep |= place == place[first]
            self._found = self._rows + int(keep[:first].sum())
        self._rows += int(keep.sum())
        totals = np.where(truth.known, expectation.totals, 0.0)
        columns = truth.inputs, totals, truth.targets
        self._parts.append((*(some[keep] for some in columns), truth.is_building[keep]))
