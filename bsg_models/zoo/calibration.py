"""Calibration: three numbers, fitted on the val buildings, that mend how sure a model is.

A distribution with means μ and dispersions r becomes one with means e^shift · μ^slope and
dispersions e^spread · r. It keeps the order of the classes of a room; a slope below 1 is a
temperature above 1.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import torch
from scipy.optimize import minimize

from bsg_data.arrays import Floats
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.zoo.model import BeliefModel, ModelInputs, to_array
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import ModelConfig


class CalibratedModel(BeliefModel):
    """A model with a distribution of the hidden counts, which can be calibrated.

    Attributes:
        calibration: `[3]` shift, logarithm of the slope, and spread; 0 changes nothing.
    """

    calibration: torch.Tensor

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.register_buffer("calibration", torch.zeros(3, dtype=torch.float64))

    @abstractmethod
    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the hidden counts as learned; the rows of buildings are not read."""

    def predict(self, seen: Observation) -> Expectation:
        """Return the calibrated expectation; a building hides what its rooms hide."""
        learned = self.predict_hidden_counts(seen)
        calibrated = recalibrate(learned, to_array(self.calibration))
        return from_hidden_counts(seen.inputs.astype(np.float64), sum_rooms(calibrated, seen))


def recalibrate(distribution: CountDistribution, calibration: Floats) -> CountDistribution:
    """Return the distribution under the three numbers of a calibration, `[3]`."""
    shift, log_slope, spread = calibration.tolist()
    return distribution.recalibrated(shift=shift, slope=float(np.exp(log_slope)), spread=spread)


def fit_calibration(distribution: CountDistribution, hidden: Floats) -> Floats:
    """Return the calibration `[3]` that maximises the likelihood of hidden counts `[N, C]`."""

    def cost(calibration: Floats) -> float:
        return -float(recalibrate(distribution, calibration).log_probability(hidden).mean())

    minimum = minimize(cost, np.zeros(3), method="L-BFGS-B", bounds=[(-1.0, 1.0)] * 3)
    return np.asarray(minimum.x)
