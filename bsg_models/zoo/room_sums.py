"""Sum hidden counts of rooms: a building hides what its rooms hide."""

from __future__ import annotations

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.negative_binomial import POISSON

_LEAST = 1e-9  # a smaller presence, or mean, counts as none
_CLOSE = 1e-7  # relative size of the last step; it leaves an error of its square
_STEPS = 40  # of Newton's method; ten suffice unless the mean is that of one object


def sum_rooms(
    distribution: CountDistribution, seen: Observation, *, log_factor: Floats | None = None
) -> CountDistribution:
    """Let every building hide what its rooms hide.

    The rows of the buildings become one negative binomial with the mean of a sum of independent
    rooms, tilted to the product of their P(0): a house whose kitchen most likely has a stove most
    likely has one. Its variance is that of the sum if rooms are alike, and else another. A building
    without rooms hides f / (1 − f) of what was seen of it. Objects of the null region, which are in
    no room, count as all seen; HM3D's public scenes have none with a class.

    `log_factor` `[N, C]` is then added to the log odds of none, of rooms and of buildings.
    """
    inputs = seen.inputs
    is_room, first = ~seen.is_building[:, None], seen.starts[:-1]
    none = np.log1p(-distribution.presence.clip(max=1 - 1e-12))
    mean, variance, log_none = (
        np.add.reduceat(values * is_room, first)
        for values in (distribution.mean, distribution.variance, none)
    )
    alone = np.diff(seen.starts) == 1
    if alone.any():
        share = seen.hidden_share.astype(np.float64)[first][alone, None]
        mean[alone] = variance[alone] = inputs[first][alone] * share / np.maximum(1 - share, 1e-6)
        log_none[alone] = 0.0
    excess = variance - mean  # of the variance over a Poisson's
    dispersion = np.divide(
        mean**2, excess, out=np.full_like(mean, POISSON), where=excess > 1e-9 * np.maximum(mean, 1)
    )
    tilt, some = np.zeros_like(mean), -np.expm1(log_none) > _LEAST
    mean[some], tilt[some] = _tilt_none(mean[some], dispersion[some], log_none[some])
    if log_factor is not None:
        distribution = distribution.with_none_likelier(log_factor)
        tilt += log_factor[first]
    means, dispersions = distribution.means.copy(), distribution.dispersions.copy()
    tilts = np.zeros((1, *means.shape)) if distribution.tilts is None else distribution.tilts.copy()
    means[:, first], dispersions[:, first], tilts[1:, :, first], tilts[0][:, first] = (
        mean,
        dispersion,
        0.0,
        tilt,
    )
    weights = distribution.weights
    if weights.shape[2] > 1:  # the components of a building are equal, whatever their weights
        weights = weights.copy()
        weights[:, first] = 1 / len(weights)
    return CountDistribution(means, dispersions, weights, tilts)


def _tilt_none(mean: Floats, dispersion: Floats, log_none: Floats) -> tuple[Floats, Floats]:
    """Return mean before tilt, and tilt of none, of counts with a given mean and P(0), each `[M]`.

    A tilt of none keeps m / (1 − p), the mean given that there is one, with p the untilted P(0). So
    m solves m / (1 − p(m)) = mean / P(at least one). Newton's steps begin above the root of a
    convex function, and fall to it.
    """
    present = -np.expm1(log_none)
    given = np.maximum(mean / present, 1 + 1e-9)

    def log_untilted(base: Floats) -> tuple[Floats, Floats]:
        """Return log P(0), and log of −dP(0)/dμ: −(r + 1) log(1 + μ / r)."""
        spread = np.log1p(base / dispersion)
        return -dispersion * spread, -(dispersion + 1) * spread

    base = given.copy()
    for _ in range(_STEPS):
        none, fall = log_untilted(base)
        step = (base + given * np.expm1(none)) / (1 - given * np.exp(fall))
        base, before = np.maximum(base - step, _LEAST), base
        if (np.abs(base - before) <= _CLOSE * base).all():  # later steps change only rounding
            break
    untilted = log_untilted(base)[0]
    tilt = (log_none - np.log(present)) - (untilted - np.log(-np.expm1(untilted)))
    return base, tilt
