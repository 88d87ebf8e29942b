"""Collect the nodes for the figures of an evaluation: all of them, or a part of very many."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.truth import Truth


@dataclass(frozen=True, eq=False)
class ShownNodes:
    """What is seen, expected and true of M nodes."""

    inputs: Floats  # `[M, C]` histograms that the masks leave
    totals: Floats  # `[M, C]` whole histograms as the model predicts them
    targets: Floats  # `[M, C]` true histograms
    is_building: Bools  # `[M]`
    example: int  # row of the node that is drawn separately


class ShownCollector:
    """A collector of every k-th masked building, and always of the example in its first draw.

    Args:
        stride: k.
        example: scene id of the example.
    """

    def __init__(self, stride: int, example: str) -> None:
        self._stride, self._example = stride, example
        self._masked = self._rows = 0
        self._found: int | None = None
        self._parts: list[tuple[Floats, Floats, Floats, Bools]] = []

    def add(self, truth: Truth, expectation: Expectation) -> None:
        """Add some masked buildings; each begins with its building node."""
        place = self._masked + np.cumsum(truth.is_building) - 1
        self._masked += int(truth.is_building.sum())
        keep = place % self._stride == 0
        if self._found is None and self._example in truth.scene_ids:
            number = truth.scene_ids.index(self._example)
            first = int(np.flatnonzero(truth.is_building & (truth.building == number))[0])
            keep |= place == place[first]
            self._found = self._rows + int(keep[:first].sum())
        self._rows += int(keep.sum())
        columns = truth.inputs, expectation.totals, truth.targets
        self._parts.append((*(some[keep] for some in columns), truth.is_building[keep]))

    def finish(self) -> ShownNodes:
        """Return what was collected."""
        inputs, totals, targets = (
            np.concatenate([part[number] for part in self._parts]) for number in range(3)
        )
        is_building = np.concatenate([part[3] for part in self._parts])
        return ShownNodes(inputs, totals, targets, is_building, self._found or 0)
