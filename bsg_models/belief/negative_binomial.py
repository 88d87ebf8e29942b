"""The negative binomial: counts whose rates vary as a Gamma.

With mean μ and dispersion r it has variance μ + μ²/r; r = ∞ is a Poisson.

    Λ ~ Gamma(r, rate b)                         its mean is r / b
    T | Λ ~ Poisson(Λ)                           so that T ~ NB(mean r / b, dispersion r)
    a mask that hides a share f of T             V | Λ ~ Poisson((1 − f) Λ), H | Λ ~ Poisson(f Λ)
    after V was seen                             Λ | V ~ Gamma(r + V, b + 1 − f), so that
                                                 H | V ~ NB(f (r + V) / (b + 1 − f), r + V)
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from bsg_data.arrays import Floats

Array = TypeVar("Array", bound=Any)  # of NumPy or of torch


def hidden_posterior(shape: Array, rate: Array, seen: Array, share: Array) -> tuple[Array, Array]:
    """Return mean and dispersion of the hidden counts after some were seen.

    The four arguments broadcast against each other.

    Args:
        shape: r of the Gamma prior of the rate.
        rate: b of it.
        seen: V, the counts that were seen.
        share: f, the share that is hidden.
    """
    dispersion = shape + seen
    return share * dispersion / (rate + 1 - share), dispersion


def log_negative_binomial(
    counts: Floats | npt.NDArray[np.integer], mean: Floats | float, dispersion: Floats | float
) -> Floats:
    """Return log P(counts); the arguments broadcast against each other.

    Args:
        counts: whole numbers of 0 or more.
        mean: μ > 0.
        dispersion: r > 0, finite.
    """
    choose = gammaln(counts + dispersion) - gammaln(dispersion) - gammaln(counts + 1)
    power = counts * (np.log(mean) - np.log(mean + dispersion))
    return np.asarray(choose + log_none(mean, dispersion) + power)


def log_likelihood(
    counts: Floats | npt.NDArray[np.integer], mean: Floats | float, dispersion: Floats | float
) -> Floats:
    """Return log P(counts) without the term −log counts!, on which no fit depends."""
    choose = gammaln(counts + dispersion) - gammaln(dispersion)
    power = counts * np.log(mean / (mean + dispersion))
    return np.asarray(choose + log_none(mean, dispersion) + power)


def log_none(mean: Floats | float, dispersion: Floats | float) -> Floats:
    """Return log P(0); dispersions are finite."""
    return np.asarray(-dispersion * np.log1p(mean / dispersion))


def log_beyond_none(counts: Floats, mean: Floats, dispersion: Floats) -> Floats:
    """Return log P(counts) − log P(0), which most counts, being 0, do not need."""
    power = counts * (np.log(mean / dispersion) - np.log1p(mean / dispersion))
    choose = gammaln(counts + dispersion) - gammaln(dispersion) - gammaln(counts + 1)
    return np.asarray(choose + power)
