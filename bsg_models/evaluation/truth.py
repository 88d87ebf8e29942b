"""Define what is measured: the truth of masked pairs, and a model's expectation of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats
from bsg_models.belief.expectation import Expectation

NODE_SETS = ("rooms", "building", "all")


@dataclass(frozen=True, eq=False)
class Truth:
    """The stored pairs of a split, over all N nodes of all draws."""

    inputs: Floats  # `[N, C]` histograms that the masks leave
    targets: Floats  # `[N, C]` true histograms
    is_building: Bools  # `[N]`
    visited: Bools  # `[N]` whether the robot entered
    building: npt.NDArray[np.int64]  # `[N]` 0..B-1, the number of the node's building
    draw: npt.NDArray[np.int64]  # `[N]` number of the mask
    scene_ids: tuple[str, ...]  # `[B]`
    # `[N, C]` whether the source has a word for the class; of the others nothing is true. None: all
    nameable: Bools | None = None

    @property
    def known(self) -> Bools:
        """Whether the true count is known, `[N, C]`; only these cells are measured."""
        return np.ones(self.targets.shape, dtype=bool) if self.nameable is None else self.nameable

    @property
    def hidden(self) -> Floats:
        """Hidden counts, `[N, C]`."""
        return self.targets - self.inputs


@dataclass(frozen=True, eq=False)
class Prediction:
    """A model's expectation and the truth: the input of a metric."""

    truth: Truth  # of N nodes
    expectation: Expectation  # of the same nodes

    @cached_property
    def rows(self) -> Mapping[str, npt.NDArray[np.int64]]:
        """Node set → its rows."""
        building = self.truth.is_building
        sets = {"rooms": ~building, "building": building, "all": np.ones_like(building)}
        return {name: np.flatnonzero(mask) for name, mask in sets.items()}
