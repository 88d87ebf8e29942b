"""Sum errors in number and presence by class, of one model, batch by batch."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.metrics import Floats
from bsg_models.evaluation.presence import PresenceHistograms
from bsg_models.evaluation.truth import Truth

SETS = ("rooms", "building")


class ClassErrors:
    """Sums by class over the rooms, and over the buildings, of one model."""

    def __init__(self) -> None:
        once = np.ones((1, 1))
        self._cells = {name: PresenceHistograms(once) for name in SETS}
        self._sums: dict[str, Floats] = {}
        self._nodes = dict.fromkeys(SETS, 0)

    def add(self, truth: Truth, expectation: Expectation) -> None:
        """Add some nodes."""
        error, presence = expectation.totals - truth.targets, expectation.presence
        hidden = truth.hidden > 0
        for name, rows in zip(SETS, (~truth.is_building, truth.is_building), strict=True):
            some = error[rows]
            sums = np.stack([truth.targets[rows], some, np.abs(some)]).sum(axis=1)
            self._sums[name] = self._sums[name] + sums if name in self._sums else sums
            self._nodes[name] += int(rows.sum())
            self._cells[name].add_rooms(
                presence=presence[rows],
                seen=truth.inputs[rows] > 0,
                hidden=hidden[rows],
                visited=truth.visited[rows],
                building=np.zeros(int(rows.sum()), dtype=np.int64),
            )

    def rows(self, model: str, classes: Sequence[str]) -> list[dict[str, Any]]:
        """Return one row per node set and class: the paper's error in number, and presence.

        Columns: `model`, `nodes` (node set), `class`, `count` (mean true number), `mean_error`
        (O″ − O), `mean_absolute_error`, `presence_auroc` and `presence_ap`.
        """
        found = []
        for name in SETS:
            count, error, absolute = self._sums[name] / max(self._nodes[name], 1)
            ranks = self._cells[name].ranks
            for c, class_name in enumerate(classes):
                found.append(
                    {
                        "model": model,
                        "nodes": name,
                        "class": class_name,
                        "count": count[c],
                        "mean_error": error[c],
                        "mean_absolute_error": absolute[c],
                        "presence_auroc": ranks.auroc_of_classes["all"][c, 0],
                        "presence_ap": ranks.precision_of_classes["all"][c, 0],
                    }
                )
        return found
