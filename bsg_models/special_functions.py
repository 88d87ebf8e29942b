"""The special functions that answers need, in NumPy: importing SciPy's takes as long as an answer.

Tests compare them with SciPy's.
"""

from __future__ import annotations

from functools import cache

import numpy as np

from bsg_data.arrays import Floats

_HALF_LOG_2PI = 0.5 * float(np.log(2 * np.pi))
_STIRLING = (1 / 12, -1 / 360, 1 / 1260, -1 / 1680, 1 / 1188)
_SHIFT = 8  # from here on Stirling's series is exact to 1e-14
_PANELS = 128  # of the integral of a Beta distribution
_BEYOND = 25.0  # decay of the logarithm of its density, where the integral ends
_STEPS = 3  # of Newton's method


def log_gamma(values: Floats) -> Floats:
    """Return log Γ(x) of x > 0 up to 1e30: Stirling's series of x + 8, and the recurrence."""
    rising = np.add.outer(np.arange(float(_SHIFT)), values).prod(axis=0)
    x = values + float(_SHIFT)
    inverse = 1 / (x * x)
    series = np.zeros_like(inverse)
    for factor in reversed(_STIRLING):
        series = series * inverse + factor
    return np.asarray((x - 0.5) * np.log(x) - x + _HALF_LOG_2PI + series / x - np.log(rising))


def log_sum_exp(values: Floats, *, axis: int, keepdims: bool = False) -> Floats:
    """Return the logarithm of the sum of exponentials over an axis; −∞ counts as 0."""
    highest = values.max(axis=axis, keepdims=True)
    highest = np.where(np.isfinite(highest), highest, 0.0)
    with np.errstate(divide="ignore"):
        total = np.log(np.exp(values - highest).sum(axis=axis, keepdims=True)) + highest
    return np.asarray(total if keepdims else total.squeeze(axis))


@cache
def gauss_legendre(number: int) -> tuple[Floats, Floats]:
    """Return nodes in (−1, 1) and weights of Gauss-Legendre quadrature."""
    return np.polynomial.legendre.leggauss(number)


def beta_quantiles(a: Floats, b: Floats, *, probabilities: Floats) -> Floats:
    """Return the quantiles `[K, R]` of R Beta distributions at K probabilities.

    Of y = logit(x) the density ∝ exp(a y) / (1 + exp(y))^(a + b) is smooth and has one peak. It is
    integrated over panels that are narrow at the peak. Newton's method then finds each quantile in
    its panel.
    """
    a, b = a[:, None, None], b[:, None, None]
    peak, wide = np.log(a / b)[:, 0], np.sqrt(1 / a + 1 / b)[:, 0]
    highest, over_peak = peak[..., None], np.logaddexp(0.0, peak)[..., None]

    def integrate(start: Floats, end: Floats) -> Floats:
        """Return the integral of the density from start to end, both `[R, M]`."""
        nodes, weights = gauss_legendre(4)
        half = (end - start) / 2
        y = start[..., None] + half[..., None] * (1 + nodes)
        return half * (density(y) @ weights)

    def density(y: Floats) -> Floats:
        """Return the density relative to its peak, `[R, M, 4]` of the same."""
        over = np.logaddexp(0.0, y) - over_peak
        return np.asarray(np.exp(a * (y - highest) - (a + b) * over))

    t = np.linspace(-1, 1, _PANELS + 1)
    reach = np.where(t < 0, _BEYOND / a[:, 0], _BEYOND / b[:, 0]) + 7 * wide
    edges = peak + reach * (np.sinh(4 * t) / np.sinh(4))  # [R, P + 1]
    parts = integrate(edges[:, :-1], edges[:, 1:])
    below = np.cumsum(parts, axis=1)
    wanted = probabilities * below[:, -1:]  # [R, K]
    panel = (below[:, :-1, None] < wanted[:, None]).sum(axis=1)
    start, end, part = (
        np.take_along_axis(values, panel, axis=1) for values in (edges[:, :-1], edges[:, 1:], parts)
    )
    wanted = wanted - (np.take_along_axis(below, panel, axis=1) - part)
    y = start + (end - start) * wanted / part
    for _ in range(_STEPS):
        step = (integrate(start, y) - wanted) / density(y[..., None])[..., 0]
        y = np.clip(y - step, start, end)
    return np.asarray(0.5 * (1 + np.tanh(0.5 * y))).T
