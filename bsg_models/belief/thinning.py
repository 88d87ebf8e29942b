"""Compute the probability of the seen counts when a share of the objects is hidden.

True counts T are a mixture of tilted negative binomials (`bsg_models.belief.count_distribution`).
Each object is hidden independently with probability s. With the prior's mean μ and dispersion r,

    V ~ NB((1 − s) μ, r)                                 without tilts
    P(V = v) = NB_V(v) Z_v / Z                           with tilts: Z_v over H | v, Z over T

as `bsg_models.belief.negative_binomial` derives.
"""

from __future__ import annotations

import numpy as np
from scipy.special import logsumexp

from bsg_data.arrays import Counts, Floats
from bsg_models.belief.count_distribution import MIN_RATE, CountDistribution
from bsg_models.belief.negative_binomial import (
    hidden_posterior,
    hidden_tilts,
    log_negative_binomial,
    log_normaliser,
)

_POISSON = 1e6  # a finite dispersion that is as good as a Poisson's


def log_seen(true: CountDistribution, seen: Counts, shares: Floats) -> Floats:
    """Return log P(V = seen) at several hidden shares, `[S, N, C]`.

    Args:
        true: distribution of the true counts.
        seen: `[N, C]` counts that were seen.
        shares: `[S, N]` hidden shares, from 0 to below 1.
    """
    means = np.maximum(true.means, MIN_RATE)
    dispersions = np.minimum(np.broadcast_to(true.dispersions, means.shape), _POISSON)
    share = shares[:, None, :, None]
    each = log_negative_binomial(seen, (1 - share) * means, dispersions)  # [S, K, N, C]
    if true.tilts is not None:
        hidden = hidden_posterior(dispersions, dispersions / means, seen, share)
        tilts = np.stack(hidden_tilts(true.tilts, np.broadcast_to(seen, means.shape)))
        each = each + log_normaliser(tilts[:, None], *np.broadcast_arrays(*hidden))
        each -= log_normaliser(true.tilts, means, dispersions)
    with np.errstate(divide="ignore"):
        return np.asarray(logsumexp(each + np.log(true.weights), axis=1))
