"""Calibration: three numbers, fitted on the val buildings, that mend how sure a model is.

A law with means μ and dispersions r becomes one with means e^shift · μ^slope and dispersions
e^spread · r. It keeps the order of the classes of a room; a slope below 1 is a temperature above 1.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import torch
from scipy.optimize import minimize
from torch_geometric.data import Data

from bsg_models.expectation import Expectation, from_law
from bsg_models.hidden_counts import Floats, HiddenCounts
from bsg_models.model import BeliefModel, to_array
from bsg_models.room_sums import sum_rooms


class CalibratedModel(BeliefModel):
    """A model with a law of the hidden counts, which can be calibrated.

    Attributes:
        calibration: `[3]` shift, logarithm of the slope, and spread; 0 changes nothing.
    """

    calibration: torch.Tensor

    def __init__(self) -> None:
        super().__init__()
        self.register_buffer("calibration", torch.zeros(3, dtype=torch.float64))

    @abstractmethod
    def believe(self, graphs: Data) -> HiddenCounts:
        """Return the law of the hidden counts as learned; the rows of buildings are not read."""

    def predict(self, graphs: Data) -> Expectation:
        """Return the calibrated expectation; a building hides what its rooms hide."""
        inputs = to_array(graphs.x)
        law = recalibrate(self.believe(graphs), to_array(self.calibration))
        return from_law(inputs, sum_rooms(law, inputs, graphs))


def recalibrate(law: HiddenCounts, calibration: Floats) -> HiddenCounts:
    """Return the law under the three numbers of a calibration, `[3]`."""
    shift, log_slope, spread = calibration.tolist()
    return law.recalibrated(shift=shift, slope=float(np.exp(log_slope)), spread=spread)


def fit_calibration(law: HiddenCounts, hidden: Floats) -> Floats:
    """Return the calibration `[3]` that maximises the likelihood of hidden counts `[N, C]`."""

    def cost(calibration: Floats) -> float:
        return -float(recalibrate(law, calibration).log_probability(hidden).mean())

    found = minimize(cost, np.zeros(3), method="L-BFGS-B", bounds=[(-1.0, 1.0)] * 3)
    return np.asarray(found.x)
