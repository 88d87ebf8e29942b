"""Shrinkage per class: Poisson counts whose rates vary from room to room as a Gamma.

    rate of class c in a room   Λ ~ Gamma(a_c, b_c)
    what is there               T | Λ ~ Poisson(Λ)
    a mask that hides f of it   V | Λ ~ Poisson((1 − f) Λ),  H | Λ ~ Poisson(f Λ), independent
    so                          Λ | V ~ Gamma(a_c + V, b_c + 1 − f)
                                H | V ~ NB(mean f (a_c + V) / (b_c + 1 − f), dispersion a_c + V)

a and b maximise the likelihood of the training rooms' counts, T ~ NB(mean a/b, dispersion a).
"""

from __future__ import annotations

import numpy as np
import numpy.typing as npt
import torch
from scipy.optimize import minimize
from scipy.special import gammaln
from torch_geometric.data import Data

from bsg_models.expectation import Expectation, Floats, from_hidden
from bsg_models.graph_dataset import Buildings
from bsg_models.model import BeliefModel, to_array


class GammaPoissonModel(BeliefModel):
    """Shrink each room's counts to its class; the building is the sum of its rooms.

    Attributes:
        shape: `[C]` a of the Gamma prior.
        rate: `[C]` b of the Gamma prior.
    """

    shape: torch.Tensor
    rate: torch.Tensor

    def __init__(self, classes: int) -> None:
        super().__init__()
        self.register_buffer("shape", torch.ones(classes, dtype=torch.float64))
        self.register_buffer("rate", torch.ones(classes, dtype=torch.float64))

    def fit(self, data: Buildings, scenes: tuple[str, ...]) -> None:
        """Fit the prior of every class to the counts of the training rooms."""
        rooms = np.concatenate([data.cells[scene][1:] for scene in scenes])
        fitted = np.array([fit_gamma_prior(column) for column in rooms.T])
        self.shape.copy_(torch.from_numpy(fitted[:, 0]))
        self.rate.copy_(torch.from_numpy(fitted[:, 1]))

    def predict(self, graphs: Data) -> Expectation:
        """Return the posterior of the hidden counts."""
        inputs, fraction = to_array(graphs.x), to_array(graphs.fraction)[:, None]
        a, b = to_array(self.shape), to_array(self.rate)
        dispersion = a + inputs
        hidden = fraction * dispersion / (b + 1 - fraction)
        hidden, dispersion = sum_rooms(hidden, dispersion, graphs)
        return from_hidden(inputs, hidden, dispersion)


def sum_rooms(hidden: Floats, dispersion: Floats, graphs: Data) -> tuple[Floats, Floats]:
    """Let every building hide what its rooms hide, with the dispersion that has their variance.

    Args:
        hidden: `[N, C]` means; the building's rows are replaced.
        dispersion: `[N, C]` of the rooms' negative binomials.
        graphs: a graph or a batch; a building is the first of its nodes.

    Returns:
        hidden and dispersion `[N, C]`. A building without rooms keeps its own.
    """
    building = np.cumsum(graphs.is_building.numpy()) - 1
    rooms = ~graphs.is_building.numpy()
    count = int(building[-1]) + 1 if len(building) else 0
    mean = np.zeros((count, hidden.shape[1]))
    excess = np.zeros_like(mean)  # of the variance over a Poisson's
    np.add.at(mean, building[rooms], hidden[rooms])
    np.add.at(excess, building[rooms], hidden[rooms] ** 2 / dispersion[rooms])
    has_rooms = np.bincount(building[rooms], minlength=count) > 0
    first = np.flatnonzero(~rooms)[has_rooms]
    hidden, dispersion = hidden.copy(), dispersion.copy()
    hidden[first] = mean[has_rooms]
    square = mean[has_rooms] ** 2
    dispersion[first] = np.divide(
        square, excess[has_rooms], out=np.full_like(square, 1e6), where=excess[has_rooms] > 0
    )
    return hidden, dispersion


def fit_gamma_prior(counts: npt.NDArray[np.integer]) -> tuple[float, float]:
    """Return (a, b) that maximise the likelihood of counts `[R]` as a Gamma-Poisson mixture.

    A class that never occurs gets a prior as weak as half an object in all rooms together.
    """
    values, times = np.unique(counts, return_counts=True)
    mean = max(float(counts.mean()), 0.5 / len(counts))

    def cost(log_shape: Floats) -> float:
        a = float(np.exp(log_shape[0]))
        terms = gammaln(a + values) - gammaln(a) - a * np.log1p(mean / a)
        terms = terms + values * np.log(mean / (mean + a))
        return -float(times @ terms)

    found = minimize(cost, x0=np.zeros(1), bounds=[(-8.0, 8.0)], method="L-BFGS-B")
    a = float(np.exp(found.x[0]))
    return a, a / mean
