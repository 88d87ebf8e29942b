"""A building hides what its rooms hide."""

from __future__ import annotations

import numpy as np
from torch_geometric.data import Data

from bsg_models.hidden_counts import Floats, HiddenCounts
from bsg_models.model import building_of, to_array


def sum_rooms(law: HiddenCounts, inputs: Floats, graphs: Data) -> HiddenCounts:
    """Let every building hide what its rooms hide.

    Args:
        law: of all nodes; the rows of the buildings are replaced by one negative binomial, with
            the mean and the variance of a sum of independent rooms.
        inputs: `[N, C]`.
        graphs: a graph or a batch; a building is the first of its nodes.

    Objects of the null region, which are in no room (HM3D's public scenes have none with a class),
    are taken to be all seen.

    Returns:
        the law. A building without rooms hides f / (1 − f) of what was seen of it.
    """
    is_building, building = graphs.is_building.numpy(), building_of(graphs).numpy()
    count = int(is_building.sum())
    sums = np.zeros((2, count, inputs.shape[1]))
    rooms = np.flatnonzero(~is_building)
    of_rooms = law.take(rooms)
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
    means, dispersions = law.means.copy(), law.dispersions.copy()
    means[:, first], dispersions[:, first] = mean, dispersion
    return HiddenCounts(means, dispersions, law.weights)
