"""Compute negative binomials: counts whose rates vary as a Gamma.

With mean μ and dispersion r the variance is μ + μ²/r; r = ∞ is a Poisson.

    Λ ~ Gamma(r, rate b)                         its mean is r / b
    T | Λ ~ Poisson(Λ)                           so that T ~ NB(mean r / b, dispersion r)
    a mask that hides a share f of T             V | Λ ~ Poisson((1 − f) Λ), H | Λ ~ Poisson(f Λ)
    after V was seen                             Λ | V ~ Gamma(r + V, b + 1 − f), so that
                                                 H | V ~ NB(f (r + V) / (b + 1 − f), r + V)

A negative binomial is always wider than a Poisson: with one fridge seen, it expects another. A
*tilt* corrects that. It multiplies the prior of the true count T by exp(a_T) for the first J
counts, and by 1 beyond. Thinning and the normaliser of the prior cancel, so the results stay in
closed form:

    P(H = h | V = v) = NB(h) exp(a_{v+h}) / Z_v,    Z_v = 1 + Σ_h NB(h) (exp(a_{v+h}) − 1)
    P(V = v) = NB_V(v) Z_v / Z                      Z the same sum over the prior of T
"""

from __future__ import annotations

from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln

from bsg_data.arrays import Floats

Array = TypeVar("Array", bound=Any)  # of NumPy or of torch
TINY = 1e-30  # a smaller normaliser is rounding error


def hidden_posterior(shape: Array, rate: Array, seen: Array, share: Array) -> tuple[Array, Array]:
    """Return mean and dispersion of the hidden counts after some were seen.

    The four arguments broadcast against each other.

    Args:
        shape: r of the Gamma prior of the rate.
        rate: b of the Gamma prior.
        seen: V, the counts that were seen.
        share: f, the share that is hidden.
    """
    dispersion = shape + seen
    return share * dispersion / (rate + 1 - share), dispersion


def hidden_tilts(tilts: Array, seen: Array) -> list[Array]:
    """Return the tilts of the hidden counts 0..J−1 after some were seen: a_{v+h}, 0 beyond J.

    Args:
        tilts: a of the true counts 0..J−1 on the first axis; the other axes broadcast with `seen`.
        seen: V, the counts that were seen.
    """
    number = len(tilts)
    return [
        sum(tilts[t] * (seen + h == t) for t in range(h + 1, number)) + tilts[h] * (seen == 0)
        for h in range(number)
    ]


def first_counts(number: int, none: Array, mean: Array, dispersion: Array) -> list[Array]:
    """Return the probabilities of the counts 0..number−1, each computed from the one before.

    Args:
        number: J.
        none: P(0).
        mean: μ.
        dispersion: r, finite.
    """
    probabilities = [none]
    success = mean / (mean + dispersion)
    for count in range(number - 1):
        step = success * (dispersion + count) / (count + 1)
        probabilities.append(probabilities[-1] * step)
    return probabilities[:number]


def log_normaliser(tilts: Floats, mean: Floats, dispersion: Floats) -> Floats:
    """Return log Z of tilted negative binomials; the first axis of `tilts` is the counts 0..J−1.

    Dispersions must be finite.
    """
    counts = first_counts(len(tilts), np.exp(log_none(mean, dispersion)), mean, dispersion)
    gained = sum(p * np.expm1(tilt) for p, tilt in zip(counts, tilts, strict=True))
    return np.asarray(np.log(np.maximum(1 + gained, TINY)))


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
    """Return log P(0); dispersions must be finite."""
    return np.asarray(-dispersion * np.log1p(mean / dispersion))


def log_beyond_none(counts: Floats, mean: Floats, dispersion: Floats) -> Floats:
    """Return log P(counts) − log P(0); most counts are 0 and do not need it."""
    power = counts * (np.log(mean / dispersion) - np.log1p(mean / dispersion))
    choose = gammaln(counts + dispersion) - gammaln(dispersion) - gammaln(counts + 1)
    return np.asarray(choose + power)
