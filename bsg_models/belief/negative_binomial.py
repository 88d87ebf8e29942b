"""Compute negative binomials: counts whose rates vary as a Gamma.

With mean μ and dispersion r the variance is μ + μ²/r; a large r is a Poisson.

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

Every function takes arrays of NumPy or tensors of torch, and returns the same kind; those of what
was seen, and slopes, take NumPy alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, TypeVar

import numpy as np

from bsg_data.arrays import Floats
from bsg_models.arrays import add_rows, library_of
from bsg_models.special_functions import log_gamma

Array = TypeVar("Array", bound=Any)  # of NumPy or of torch
POISSON = 1e15  # the dispersion of a Poisson: its variance is μ (1 + μ / r)
TINY = 1e-30  # a smaller normaliser is rounding error
_LARGE = 1e6  # dispersion from which log Γ(r + count) − log Γ(r) has lost its digits
_LEAST = 1e-9  # mean of what was seen: none is impossible
_MOST_TILT = 600.0  # largest exponent computed: e^709 is the largest number


def hidden_posterior(shape: Array, rate: Array, seen: Array, share: Array) -> tuple[Array, Array]:
    """Return mean and dispersion of the hidden counts after V were seen.

    Arguments broadcast: r and b of the Gamma prior of the rate, V, and the hidden share f.
    """
    dispersion = shape + seen
    return share * dispersion / (rate + 1 - share), dispersion


def hidden_tilts(tilts: Array, seen: Array) -> list[Array]:
    """Return the tilts of the hidden counts 0..J−1 after V were seen: a_{v+h}, 0 beyond J.

    The first axis of `tilts` is J; the others broadcast with `seen`.
    """
    number = len(tilts)
    return [
        sum(tilts[t] * (seen + h == t) for t in range(h + 1, number)) + tilts[h] * (seen == 0)
        for h in range(number)
    ]


def first_counts(number: int, none: Array, mean: Array, dispersion: Array) -> list[Array]:
    """Return P(0), …, P(J − 1), each computed from the one before; r is finite."""
    probabilities = [none]
    success = mean / (mean + dispersion)
    for count in range(number - 1):
        step = success * (dispersion + count) / (count + 1) if count else success * dispersion
        probabilities.append(probabilities[-1] * step)
    return probabilities[:number]


def tilt_gains(
    tilts: Any, mean: Array, dispersion: Array, *, none: Array | None = None
) -> list[Array]:
    """Return what tilts add to P(0), …, P(J − 1) before these are normalised.

    It is NB(t) (exp(a_t) − 1); `tilts` are a of the counts 0..J−1, an array each. `none` is log
    P(0), if it is known.
    """
    xp = library_of(mean)
    none = log_none(mean, dispersion) if none is None else none
    first = first_counts(len(tilts), xp.exp(none), mean, dispersion)
    if xp is np and not any((tilt > _MOST_TILT).any() for tilt in tilts[:1]):
        return [
            probability * xp.expm1(tilt) for probability, tilt in zip(first, tilts, strict=True)
        ]
    gains = [
        probability * xp.expm1(tilt * (tilt <= _MOST_TILT))
        for probability, tilt in zip(first, tilts, strict=True)
    ]
    if gains:  # in a large building P(0) underflows, and its tilt overflows
        gains[0] = gains[0] + xp.exp(none + tilts[0]) * (tilts[0] > _MOST_TILT)
    return gains


def log_normaliser(
    tilts: Any, mean: Array, dispersion: Array, *, none: Array | None = None
) -> Array:
    """Return log Z of negative binomials; arguments as of `tilt_gains`."""
    gains = tilt_gains(tilts, mean, dispersion, none=none)
    total = 1 + sum(gains) if gains else library_of(mean).ones_like(mean * dispersion)
    normaliser: Array = library_of(mean).log(total.clip(TINY))
    return normaliser


def log_negative_binomial(counts: Any, mean: Array, dispersion: Any) -> Array:
    """Return log P(counts) for μ > 0, r > 0; arguments broadcast."""
    log_p: Array = _log_beyond_none(counts, mean, dispersion) + log_none(mean, dispersion)
    return log_p


def log_none(mean: Array, dispersion: Any) -> Array:
    """Return log P(0)."""
    none: Array = -dispersion * library_of(mean).log1p(mean / dispersion)
    return none


def _log_beyond_none(counts: Any, mean: Array, dispersion: Any) -> Array:
    """Return log P(counts) − log P(0); most counts are 0 and do not need it."""
    xp = library_of(mean)
    power = counts * (xp.log(mean) - xp.log(mean + dispersion))
    beyond: Array = _log_rising(counts, dispersion) - _log_gamma(counts + 1.0) + power
    return beyond


def log_counts(
    log_p: Array, counts: Any, positive: Any, mean: Array, dispersion: Array, tilts: Any
) -> Array:
    """Return log P(counts) `[K, N, C]` of K components from `log_p`, that of none before its tilt.

    `positive` `[P]` are the places, of N · C, of the counts `[N, C]` above 0; most are 0.
    """
    for count, tilt in enumerate(tilts):
        log_p = log_p + tilt * (counts == count)
    flat = mean.shape[0], -1
    some = (part.reshape(flat)[:, positive] for part in (mean, dispersion))
    beyond = _log_beyond_none(counts.reshape(-1)[positive], *some)
    whole: Array = add_rows(log_p.reshape(flat).T, positive, beyond.T).T.reshape(mean.shape)
    return whole


def none_seen(share: Array, mean: Array, dispersion: Array, gains: Sequence[Array]) -> Array:
    """Return P(V = 0) if each of T objects is hidden with probability `share`; μ > 0.

    Of the gains of T's tilts it is NB_V(0) Z_0 / Z, with NB_V(0) Z_0 = NB_V(0) + Σ_t gain_t s^t.
    """
    none: Array = np.exp(log_none(np.maximum((1 - share) * mean, _LEAST), dispersion))
    for count, gain in enumerate(gains):
        none = none + share**count * gain
    normalised: Array = none / np.maximum(1 + sum(gains), TINY)
    return normalised


def log_seen(seen: Any, share: Array, mean: Array, dispersion: Array, tilts: Array | None) -> Array:
    """Return log P(V = seen) by logarithms alone: a count may be very unlikely."""
    log_p: Array = log_negative_binomial(seen, np.maximum((1 - share) * mean, _LEAST), dispersion)
    if tilts is None:
        return log_p
    hidden = hidden_posterior(dispersion, dispersion / mean, seen, share)
    of_hidden = log_normaliser(hidden_tilts(tilts, seen), *hidden)
    tilted: Array = log_p + of_hidden - log_normaliser(tilts, mean, dispersion)
    return tilted


def _log_rising(counts: Any, dispersion: Any) -> Any:
    """Return log Γ(r + counts) − log Γ(r)."""
    xp = library_of(dispersion)
    large = dispersion > _LARGE
    small = xp.where(large, 1.0, dispersion)
    series = counts * (xp.log(dispersion) + (counts - 1.0) / (2 * dispersion))
    return xp.where(large, series, _log_gamma(counts + small) - _log_gamma(small))


def rising_slope(counts: Floats | int, dispersion: Floats) -> Floats:
    """Return the derivative of log Γ(r + counts) − log Γ(r) by log r: r (ψ(r + counts) − ψ(r))."""
    if isinstance(counts, int):  # a small one
        return sum((dispersion / (dispersion + j) for j in range(counts)), np.zeros(()))
    from scipy.special import digamma  # only trainings come here

    small = np.minimum(dispersion, _LARGE)
    series = counts - counts * (counts - 1.0) / (2 * dispersion)
    exact = small * (digamma(counts + small) - digamma(small))
    return np.asarray(np.where(dispersion > _LARGE, series, exact))


def _log_gamma(values: Any) -> Any:
    return log_gamma(values) if library_of(values) is np else values.lgamma()
