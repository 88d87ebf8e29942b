"""A building hides what its rooms hide."""

from __future__ import annotations

import numpy as np

from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution


def sum_rooms(distribution: CountDistribution, seen: Observation) -> CountDistribution:
    """Let every building hide what its rooms hide.

    Args:
        distribution: of all nodes; the rows of the buildings are replaced by one negative
            binomial, with the mean and the variance of a sum of independent rooms.
        seen: what was seen.

    Objects of the null region, which are in no room (HM3D's public scenes have none with a class),
    are taken to be all seen.

    Returns:
        the distribution. A building without rooms hides f / (1 − f) of what was seen of it.
    """
    inputs, building, count = seen.inputs, seen.building, len(seen)
    sums = np.zeros((2, count, inputs.shape[1]))
    rooms = np.flatnonzero(~seen.is_building)
    of_rooms = distribution.take(rooms)
    for total, values in zip(sums, (of_rooms.mean, of_rooms.variance), strict=True):
        np.add.at(total, building[rooms], values)
    alone = np.bincount(building[rooms], minlength=count) == 0
    first = seen.starts[:-1]
    share = seen.hidden_share.astype(np.float64)[first][alone, None]
    sums[:, alone] = inputs[first][alone] * share / np.maximum(1 - share, 1e-6)
    mean, excess = sums[0], sums[1] - sums[0]  # of the variance over a Poisson's
    dispersion = np.divide(
        mean**2, excess, out=np.full_like(mean, np.inf), where=excess > 1e-9 * np.maximum(mean, 1)
    )
    means, dispersions = distribution.means.copy(), distribution.dispersions.copy()
    means[:, first], dispersions[:, first] = mean, dispersion
    tilts = None if distribution.tilts is None else distribution.tilts.copy()
    if tilts is not None:
        tilts[:, :, first] = 0.0
    weights = distribution.weights
    if weights.shape[2] > 1:  # components of a building are the same, whatever they weigh
        weights = weights.copy()
        weights[:, first] = 1 / len(weights)
    return CountDistribution(means, dispersions, weights, tilts)
