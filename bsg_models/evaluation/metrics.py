"""Compute the metrics: each formula is a pure function of arrays.

Shapes: N nodes of interest, C classes. `p` and `q` are distributions over classes: each row sums
to 1 or is all zero. `weights` are one number per row. A bootstrap over buildings weights each row
by how often its building was drawn, so sums and counts are accumulated first and divided once.
"""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Bools, Floats

MOMENTS = ("mean", "variance", "skewness", "kurtosis")  # of a population; excess kurtosis


def normalise(counts: Floats) -> Floats:
    """Return histograms `[N, C]` as distributions E: rows sum to 1; an all-zero row stays zero."""
    totals = counts.sum(axis=1, keepdims=True)
    filled = np.zeros_like(counts, dtype=float)
    return np.asarray(np.divide(counts, totals, out=filled, where=totals > 0))


def wasserstein_values(p: Floats, q: Floats) -> Floats:
    """Return the 1-D Wasserstein distance of the C probabilities as samples, `[N]`.

    W = 1/C Σ |p₍ᵢ₎ − q₍ᵢ₎| over the sorted values: `scipy.stats.wasserstein_distance(p, q)`. It
    is our reading of the paper's Table I, and it ignores which class has which probability.
    """
    return np.asarray(np.abs(np.sort(p, axis=1) - np.sort(q, axis=1)).mean(axis=1))


def energy_values(p: Floats, q: Floats) -> Floats:
    """Return the 1-D energy distance of the C probabilities as samples, `[N]`.

    √(2 ∫ (F_p − F_q)²) with F the empirical distribution functions of the values:
    `scipy.stats.energy_distance(p, q)`.
    """
    width = p.shape[1]
    values = np.concatenate([p, q], axis=1)
    order = np.argsort(values, axis=1, kind="stable")
    steps = np.where(order < width, 1.0, -1.0) / width
    difference = np.cumsum(steps, axis=1)[:, :-1]
    gaps = np.diff(np.take_along_axis(values, order, axis=1), axis=1)
    return np.asarray(np.sqrt(2 * (difference**2 * gaps).sum(axis=1)))


def total_variation(p: Floats, q: Floats) -> Floats:
    """Return ½ Σ |p − q|, `[N]`: the share of probability on wrong classes, 0..1."""
    return np.asarray(0.5 * np.abs(p - q).sum(axis=1))


def moments_of_sums(sums: Floats, *, centre: float = 0.0) -> tuple[Floats, ...]:
    """Return the four moments of the paper's Table I, each `[W]`, from sums of powers `[W, 5]`.

    The sums are Σ w, Σ w (x − centre), … to the power of 4; a centre near the mean keeps the digits
    of differences of powers. Without spread there is no shape, as in SciPy.
    """
    total = sums[:, :1]
    raw = np.divide(sums, total, out=np.full_like(sums, np.nan), where=total > 0)
    first, second, third, fourth = raw[:, 1:].T
    mean, variance = centre + first, np.maximum(second - first**2, 0.0)
    least = np.finfo(float).eps * np.maximum(mean**2, first**2)
    spread = np.where(variance > least, variance, np.nan)
    skewness = (third - 3 * first * second + 2 * first**3) / spread**1.5
    kurtosis = (fourth - 4 * first * third + 6 * first**2 * second - 3 * first**4) / spread**2 - 3
    return mean, variance, skewness, kurtosis


def correlation_matrix(counts: Floats) -> Floats:
    """Return the Pearson correlations of the classes over nodes, `[C, C]`.

    A class without variance gets 0 with the others and 1 with itself.
    """
    # Covariance does not depend on the origin; near the mean it loses the fewest digits.
    rows = np.column_stack([np.ones(len(counts)), counts - counts.mean(axis=0)])
    return np.asarray(correlate_sums((rows.T @ rows)[None])[0])


def correlate_sums(products: Floats) -> Floats:
    """Return the correlations `[W, C, C]` from Σ z zᵀ `[W, 1 + C, 1 + C]`, z = (1, counts)."""
    second = products[:, 1:, 1:] / np.maximum(products[:, :1, :1], 1.0)
    mean = products[:, 0, 1:] / np.maximum(products[:, 0, :1], 1.0)
    covariance = second - mean[:, :, None] * mean[:, None, :]
    variance, square = (np.diagonal(of, axis1=1, axis2=2) for of in (covariance, second))
    spread = variance > 1e-12 * np.maximum(square, 1.0)  # a constant class has rounding error only
    scale = np.where(spread, np.sqrt(np.where(spread, variance, 1.0)), 1.0)
    correlation = covariance / (scale[:, :, None] * scale[:, None, :])
    correlation = np.where(spread[:, :, None] & spread[:, None, :], correlation, 0.0)
    return np.asarray(np.where(np.eye(correlation.shape[1], dtype=bool), 1.0, correlation))


def topk_unseen(presence: Floats, seen: Bools, hidden: Bools, *, k: int) -> Floats:
    """Return per room whether a hidden class is among its k likeliest unseen ones, `[N]`.

    All are `[N, C]`; classes in the input do not compete; ties go to the lower class index. A room
    that hides no unseen class gets nan.
    """
    order = np.argsort(np.where(seen, -np.inf, presence) * -1, axis=1, kind="stable")[:, :k]
    wanted = hidden & ~seen
    hit = np.take_along_axis(wanted, order, axis=1).any(axis=1)
    return np.where(wanted.any(axis=1), hit.astype(float), np.nan)


def mean_known(values: Floats) -> Floats:
    """Return the means over the first axis of the values that are not nan; nan without any."""
    known = ~np.isnan(values)
    number, total = known.sum(axis=0), np.where(known, values, 0.0).sum(axis=0)
    return np.asarray(np.divide(total, number, out=np.full(len(total), np.nan), where=number > 0))
