"""A building hides what its rooms hide."""

from __future__ import annotations

import numpy as np
from torch_geometric.data import Data

from bsg_models.belief.count_distribution import CountDistribution, Floats
from bsg_models.zoo.model import building_numbers, to_array


def sum_rooms(distribution: CountDistribution, inputs: Floats, graphs: Data) -> CountDistribution:
    """Let every building hide what its rooms hide.

    Args:
        distribution: of all nodes; the rows of the buildings are replaced by one negative
            binomial, with the mean and the variance of a sum of independent rooms.
        inputs: `[N, C]`.
        graphs: a graph or a batch; a building is the first of its nodes.

    Objects of the null region, which are in no room (HM3D's public scenes have none with a class),
    are taken to be all seen.

    Returns:
        the distribution. A building without rooms hides f / (1 − f) of what was seen of it.
    """
    is_building, building = graphs.is_building.numpy(), building_numbers(graphs).numpy()
    count = int(is_building.sum())
    sums = np.zeros((2, count, inputs.shape[1]))
    rooms = np.flatnonzero(~is_building)
    of_rooms = distribution.take(rooms)
    for total, values in zip(sums, (of_rooms.mean, of_rooms.variance), strict=True):
        np.add.at(total, building[rooms], values)
    alone = np.bincount(building[rooms], minlength=count) == 0
    first = np.flatnonzero(is_building)
    share = to_array(graphs.fraction)[first][alone, None]
    sums[:, alone] = inputs[first][alone] * share / np.maximum(1 - share, 1e-6)
    mean, excess = sums[0], sums[1] - sums[0]  # of the variance over a Poisson's
    dispersion = np.divide(
        mean**2, excess, out=np.full_like(mean, np.inf), where=excess > 1e-9 * np.maximum(mean, 1)
    )
    means, dispersions = distribution.means.copy(), distribution.dispersions.copy()
    means[:, first], dispersions[:, first] = mean, dispersion
    return CountDistribution(means, dispersions, distribution.weights)
