"""Uncertain hidden shares, as levels at which a model is asked: quadrature over what is believed.

What is hidden in a room whose share S is uncertain is the mixture over S of what is hidden at each
share. K levels of probability u_k, with their weights w_k, are the nodes of Gauss and Legendre on
(0, 1); at a level every uncertain room hides the u_k-quantile of its own Beta distribution:

    P(H) = ∫ P(H | S = F⁻¹(u)) du ≈ Σ_k w_k P(H | S = F⁻¹(u_k))

So a building takes K copies in one pass of a model, however many of its rooms are uncertain. Rooms
are coupled: a robot that overlooked more than it thinks did so everywhere. docs/hidden-share.md has
what eight levels and this coupling cost in accuracy.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from scipy.special import betaincinv, roots_legendre

from bsg_data.arrays import Floats
from bsg_data.observation.hidden_share import ShareBelief
from bsg_data.observation.observation import Observation, stack
from bsg_data.observation.partial_graph import PartialGraph

LEVELS = 8  # a presence is then off by .0004 in the mean, and by .011 at most


def spread_shares(
    graph: PartialGraph, seen: Observation, *, levels: int = LEVELS
) -> tuple[Observation, Floats]:
    """Return what was seen at several levels of the hidden shares, and what each level weighs.

    Args:
        graph: what a robot knows of R rooms.
        seen: the same as arrays, of N = 1 + R nodes.
        levels: K.

    Returns:
        K copies of the building, one a level, and weights `[K]` whose sum is 1. Where every share
        is certain it is the observation itself, and the weight 1.
    """
    beliefs = [room.share for room in graph.rooms]
    if all(belief.is_certain for belief in beliefs):
        return seen, np.ones(1)
    nodes, weights = roots_legendre(levels)
    copies = []
    for shares in find_quantiles(beliefs, (1 + nodes) / 2):
        told = np.array([graph.share_with(shares.tolist()), *shares], dtype=np.float32)
        copies.append(replace(seen, hidden_share=told))
    return stack(copies), weights / 2


def find_quantiles(beliefs: Sequence[ShareBelief], probabilities: Floats) -> Floats:
    """Return the quantiles `[K, R]` of R shares at K probabilities."""
    quantiles = np.tile([belief.mean for belief in beliefs], (len(probabilities), 1))
    unsure = [room for room, belief in enumerate(beliefs) if not belief.is_certain]
    if unsure:
        parameters = np.array([beliefs[room].beta for room in unsure])
        quantiles[:, unsure] = betaincinv(*parameters.T, probabilities[:, None])
    return quantiles
