"""Estimate a mean in place of the paper's equations 1 to 3, by counting.

The paper writes the probability of a class c given the observations B = {b_1 … b_m} as

    P(c | B) = Σ_j P(c ∩ b_j) / Π_j P(b_j)                                     (equation 1)

with counts a_bj of the observations in equation 2, and for the count a_c of the class in equation
3. A sum of joint probabilities over a product of marginals is no probability: it grows without
bound with m. For one observation it is P(c | b_j). We keep this reading and average over the
observations with equal weights, which normalises it:

    P(c | B) = 1/m Σ_j P(c | b_j)
    P(c | b_j) = (n(c, b_j) + s P(c)) / (n(b_j) + s)

n counts rooms of the training buildings under masks. b_j means that class j was seen (`observe =
"classes"`), or seen 1, 2, 3 or more times (`"counts"`). c means that an object of the class was
hidden. s is the smoothing. Each pair (c, b_j) is estimated separately.

P(0) and the mean of equation 3's distribution of the hidden count are averaged in the same way. The
result is the zero-inflated Poisson with both; if the mean is too small for that, the Poisson with
this P(0). If nothing was seen, the values are those of all rooms. At another fraction than that of
the counting, the rate is scaled.
"""

from __future__ import annotations

from collections.abc import Iterator
from typing import Literal

import numpy as np
from pydantic import Field

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import BATCH, MaskedBuildings, stream_sampled
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.count_distribution import zero_inflated
from bsg_models.belief.expectation import Expectation
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import DataConfig, ModelConfig

_LEVELS = 4  # 1, 2, 3, and more


class ConditionalConfig(ModelConfig):
    """The paper's equations 1 to 3 as a mean, by counting on masks of the training rooms."""

    family: Literal["conditional"] = "conditional"
    # Condition on the classes seen (equation 1), or on the count of each (2, 3).
    observe: Literal["classes", "counts"] = "counts"
    smoothing: float = Field(default=2.0, gt=0, allow_inf_nan=False)  # s
    draws: int = Field(default=20, ge=1, le=1000)  # masks of every training building


class ConditionalModel(BeliefModel):
    """The mean of what each observation predicts."""

    # [C · levels + 1, C] P(an object of the column's class is hidden | the row's observation) and
    # mean number of hidden objects; the last row is over all rooms.
    presence: Floats
    hidden: Floats
    fraction: Floats  # of the masks of the counting

    config: ConditionalConfig

    def __init__(self, config: ConditionalConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.levels = _LEVELS if config.observe == "counts" else 1
        shape = (inputs.classes * self.levels + 1, inputs.classes)
        self.hold(presence=np.zeros(shape), hidden=np.zeros(shape), fraction=1.0)

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Count on masks of the training rooms."""
        rows, classes = len(self.presence) - 1, self.presence.shape[1]
        rooms, number = 0, np.zeros((rows, 1))  # rooms with each observation
        given, total = np.zeros((2, rows, classes)), np.zeros((2, classes))
        for masked in stream_uniform(data, choice, draws=self.config.draws):
            is_room = ~masked.seen.is_building
            hidden = masked.hidden[is_room].astype(np.float64)
            observed = self._observe(masked.seen.inputs[is_room].astype(np.float64))
            rooms += len(hidden)
            number += observed.sum(axis=0)[:, None]
            for row, values in enumerate(((hidden > 0).astype(float), hidden)):
                given[row] += observed.T @ values
                total[row] += values.sum(axis=0)
        s, overall = self.config.smoothing, total / rooms
        presence, mean = (
            np.vstack([(some + s * usual) / (number + s), usual])
            for some, usual in zip(given, overall, strict=True)
        )
        self.hold(presence=presence, hidden=mean, fraction=choice.mask.fraction)

    def predict(self, seen: Observation) -> Expectation:
        """Return the mean over the observations of every node."""
        inputs = seen.inputs.astype(np.float64)
        observed = self._observe(inputs)
        weights = np.hstack([observed, observed.sum(axis=1, keepdims=True) == 0])
        weights /= weights.sum(axis=1, keepdims=True)
        scale = seen.cell_share / float(self.fraction)
        presence = 1 - (1 - weights @ self.presence) ** scale
        distribution = zero_inflated(presence, scale * (weights @ self.hidden))
        return Expectation(inputs, sum_rooms(distribution, seen))

    def _observe(self, seen: Floats) -> Floats:
        """Return which observations hold in each node, `[N, C · levels]`."""
        levels = np.minimum(seen, self.levels)[:, :, None] == np.arange(1, self.levels + 1)
        return np.asarray(levels.reshape(len(seen), -1).astype(float))


def stream_uniform(data: Dataset, choice: DataConfig, *, draws: int) -> Iterator[MaskedBuildings]:
    """Yield the training buildings under uniform masks of the choice's fraction.

    The masks are uniform whatever the strategy, because only partly seen rooms show what one class
    says about another. All masks of some buildings come before the next, so that each part of the
    dataset is read once.
    """
    if not choice.mask.fraction:
        raise TrainingError("masks that hide nothing teach nothing: raise data.mask.fraction")
    mask = MaskRecipe(fraction=choice.mask.fraction, seed=choice.mask.seed)
    scenes = scenes_of(data, "train", fold=choice.fold)
    streams = [stream_sampled(data, scenes, mask=mask, draw=draw) for draw in range(draws)]
    for _ in range(0, len(scenes), BATCH):
        yield from map(next, streams)


CONDITIONAL = ZooRow(ConditionalConfig(), ConditionalModel)
