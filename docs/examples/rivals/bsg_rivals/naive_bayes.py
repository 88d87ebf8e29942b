"""Predict presence by naive Bayes, from the classes that are seen in the room.

    logit P(c | B) = logit P(c) + τ Σ_j log P(b_j | c) / P(b_j | not c)

The sum is over all classes j, seen or not, as if they were independent given c; τ < 1 because they
are not. In a room that nobody looked into, only the prior counts.
"""

from __future__ import annotations

from typing import Literal

import numpy as np
from pydantic import Field
from scipy.special import expit, logit

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import zero_inflated
from bsg_models.belief.expectation import Expectation
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import DataConfig, ModelConfig
from bsg_rivals.conditional import stream_uniform


class NaiveBayesConfig(ModelConfig):
    """Presence of each class by naive Bayes from the classes that are seen.

    Attributes:
        smoothing: added to every count, as a share of the class's mean.
        draws: masks of every training building.
        temper: exponent on the evidence of each class, because they are not independent.
    """

    family: Literal["naive-bayes"] = "naive-bayes"
    smoothing: float = Field(default=2.0, gt=0, allow_inf_nan=False)
    draws: int = Field(default=20, ge=1, le=1000)
    temper: float = Field(default=0.5, gt=0, le=1)


class NaiveBayesModel(BeliefModel):
    """Presence by Bayes' rule, with the class's mean number if it is present.

    Attributes:
        prior: `[C]` P(c): an object of the class is hidden.
        seen: `[2, C, C]` P(b_j | not c) and P(b_j | c): row j, column c.
        number: `[C]` mean number hidden if there is at least one.
        fraction: of the masks of the counting.
    """

    prior: Floats
    seen: Floats
    number: Floats
    fraction: Floats

    config: NaiveBayesConfig

    def __init__(self, config: NaiveBayesConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        classes = inputs.classes
        self.hold(
            prior=np.full(classes, 0.5),
            seen=np.full((2, classes, classes), 0.5),
            number=np.ones(classes),
            fraction=1.0,
        )

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Count on masks of the training rooms."""
        classes, rooms, s = len(self.prior), 0, self.config.smoothing
        seen, there, hidden = np.zeros((3, classes))  # rooms, rooms, and objects
        both = np.zeros((classes, classes))  # rooms where the row is seen and the column is hidden
        for masked in stream_uniform(data, choice, draws=self.config.draws):
            is_room = ~masked.seen.is_building
            of_room, objects = masked.seen.inputs[is_room] > 0, masked.hidden[is_room]
            rooms += len(objects)
            seen += of_room.sum(axis=0)
            there += (objects > 0).sum(axis=0)
            hidden += objects.sum(axis=0)
            both += of_room.T.astype(float) @ (objects > 0).astype(float)
        overall = ((seen / rooms)[:, None] * s + 0.5) / (s + 1)  # never 0 or 1
        outcomes = ((seen[:, None] - both, rooms - there), (both, there))
        self.hold(
            seen=[(both + (s + 1) * overall) / (times + s + 1) for both, times in outcomes],
            prior=(there + 0.5) / (rooms + 1),
            number=(hidden + s) / (there + s),
            fraction=choice.mask.fraction,
        )

    def predict(self, seen: Observation) -> Expectation:
        """Return Bayes' rule for every node."""
        inputs, share = seen.inputs.astype(np.float64), seen.cell_share
        absent, present = self.seen
        evidence = (inputs > 0) @ np.log(present / absent)
        evidence += ((inputs == 0) & (share < 1)) @ np.log((1 - present) / (1 - absent))
        evidence *= seen.looked_into[:, None]
        odds = logit(self.prior) + self.config.temper * evidence
        scale = share / float(self.fraction)
        presence = 1 - expit(-odds) ** scale
        distribution = zero_inflated(presence, presence * self.number)
        return Expectation(inputs, sum_rooms(distribution, seen))


NAIVE_BAYES = ZooRow(NaiveBayesConfig(), NaiveBayesModel)
