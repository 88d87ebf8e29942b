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
from scipy.optimize import minimize, minimize_scalar
from scipy.special import gammaln
from torch_geometric.data import Data

from bsg_models.belief.count_distribution import Floats, negative_binomial
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.inputs.graphs import Buildings
from bsg_models.zoo.config import DataConfig
from bsg_models.zoo.model import BeliefModel, share_of, to_array
from bsg_models.zoo.room_sums import sum_rooms


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

    def fit(self, data: Buildings, choice: DataConfig) -> None:
        """Fit the prior of every class to the counts of the training rooms."""
        scenes = data.scenes_of("train", fold=choice.fold)
        rooms = np.concatenate([data.cells[scene][1:] for scene in scenes])
        fitted = np.array([fit_gamma_prior(column) for column in rooms.T])
        self.shape.copy_(torch.from_numpy(fitted[:, 0]))
        self.rate.copy_(torch.from_numpy(fitted[:, 1]))

    def predict(self, graphs: Data) -> Expectation:
        """Return the posterior of the hidden counts."""
        inputs, fraction = to_array(graphs.x), to_array(share_of(graphs))
        a, b = to_array(self.shape), to_array(self.rate)
        dispersion = a + inputs
        hidden = fraction * dispersion / (b + 1 - fraction)
        distribution = negative_binomial(hidden, dispersion)
        return from_hidden_counts(inputs, sum_rooms(distribution, inputs, graphs))


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


def fit_dispersion(counts: Floats, means: Floats) -> Floats:
    """Return the dispersions `[C]` that maximise the likelihood of counts given means `[N, C]`."""
    found = np.empty(counts.shape[1])
    for c, (values, mean) in enumerate(zip(counts.T, np.maximum(means, 1e-9).T, strict=True)):

        def cost(log_r: float, values: Floats = values, mean: Floats = mean) -> float:
            r = float(np.exp(log_r))
            terms = gammaln(r + values) - gammaln(r) - r * np.log1p(mean / r)
            return -float((terms + values * np.log(mean / (mean + r))).sum())

        found[c] = np.exp(minimize_scalar(cost, bounds=(-4.0, 6.0), method="bounded").x)
    return found
