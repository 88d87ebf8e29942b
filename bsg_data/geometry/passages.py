"""Guess which rooms one can walk between from their boxes alone.

The connections of a building are nearly a tree: one way leads from every room towards the hall or
the living room, and loops are rare. Each pair of near rooms has two weights: for reaching the first
room through the second, and the reverse. The probability of a pair is its share of all weighted
spanning forests of the building, rooted anywhere. One matrix inverse gives it (the directed
matrix-tree theorem, Tutte 1948). Without special rules it follows that small rooms have one door,
that hubs attract, and that another way in makes a pair less likely.

`scripts/fit/passages.py` at commit 4227eff fitted the weights and cross-validated them
(docs/geometry.md). Position, quarter turns, mirroring and the order of rooms change nothing.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping
from types import MappingProxyType

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints

# Pairs that are farther apart than this, in metres, never connect: the gap between them from above,
# in height, and along the wall that they would share.
_REACH, _REACH_UP, _REACH_ALONG = 1.0, 0.5, 1.0
_THINNEST = 0.05  # no room is thinner; annotated ones are

# Of each feature, in the log weight of "the child is reached through the parent".
_WEIGHTS: Mapping[str, float] = MappingProxyType(
    {
        "gap_over_6cm": -2.79,
        "thick_wall": -2.12,
        "doorway_fits": 4.52,
        "distance": -0.278,
        "step_to_1m": 2.49,
        "step_to_2m5": -1.79,
        "shared_height": 1.79,
        "parent_area": 0.597,
        "parent_offcentre": -0.559,
        "parent_touching": 1.79,
        "parent_tall": -0.488,
        "parent_corridor": 0.996,
        "child_larger": -0.596,
    }
)
_BIAS = -3.19
SLOPE, SHIFT = 0.983, 0.0582  # probability = sigmoid(SLOPE · logit(share) + SHIFT)
THRESHOLD = 0.434  # a pair connects from here up,
_JOIN = 0.2  # or from here up where it joins parts that nothing more probable joins


def score_pairs(boxes: Floats) -> tuple[Ints, Floats]:
    """Return the near pairs `[P, 2]` of boxes `[R, 2, 3]`, and how probably they connect `[P]`."""
    pairs, features = _describe_pairs(boxes)
    if not len(pairs):
        return pairs, np.zeros(0)
    log_weight = _BIAS + sum(weight * features[name] for name, weight in _WEIGHTS.items())
    share = _share_of_forests(pairs, np.asarray(log_weight), rooms=len(boxes))
    return pairs, _to_probability(share, SLOPE, SHIFT)


def _describe_pairs(boxes: Floats) -> tuple[Ints, dict[str, Floats]]:
    """Return the near pairs `[P, 2]` and their features, `[2, P]` each.

    Row 0 takes the first room of a pair as the child and the second as its parent, row 1 the
    reverse. Lengths are metres.
    """
    centre = boxes.mean(axis=1)
    size = np.maximum(boxes[:, 1] - boxes[:, 0], _THINNEST)
    low, high = centre - size / 2, centre + size / 2
    apart = np.maximum(low[:, None], low[None]) - np.minimum(high[:, None], high[None])
    gap = apart[:, :, :2].max(axis=2)  # below 0 where boxes overlap from above
    along = -apart[:, :, :2].min(axis=2)  # length of the wall that they share
    rise = -apart[:, :, 2]  # height that they share
    a, b = np.triu_indices(len(boxes), 1)
    near = (gap[a, b] < _REACH) & (rise[a, b] > -_REACH_UP) & (along[a, b] > -_REACH_ALONG)
    a, b = a[near], b[near]
    step = np.abs(low[a, 2] - low[b, 2])
    thick = np.clip((gap[a, b] - 0.08) / 0.07, 0, 1) * (1 - np.clip((gap[a, b] - 0.25) / 0.1, 0, 1))
    of_pair = {
        "gap_over_6cm": np.maximum(gap[a, b] - 0.06, 0),
        "thick_wall": thick,
        "doorway_fits": np.clip(along[a, b], 0.5, 1.0),
        "distance": np.hypot(*(centre[a, :2] - centre[b, :2]).T),
        "step_to_1m": np.minimum(step, 1.0),
        "step_to_2m5": np.minimum(step, 2.5),
        "shared_height": np.clip(rise[a, b], -0.5, 1.5),
    }
    features = {name: np.stack([values, values]) for name, values in of_pair.items()}
    of_parent = _describe_parents(centre, size, gap=gap, along=along, rise=rise)
    features |= {name: np.stack([values[b], values[a]]) for name, values in of_parent.items()}
    more = np.log(size[a, 0] * size[a, 1]) - np.log(size[b, 0] * size[b, 1])
    features["child_larger"] = np.maximum(np.stack([more, -more]), 0)
    return np.stack([a, b], axis=1).astype(np.int64), features


def _describe_parents(
    centre: Floats, size: Floats, *, gap: Floats, along: Floats, rise: Floats
) -> dict[str, Floats]:
    """Return what makes a room one that others are reached through, `[R]` each."""
    area, narrow = size[:, 0] * size[:, 1], size[:, :2].min(axis=1)
    long = np.log(size[:, :2].max(axis=1) / narrow)
    level = rise > 0.5 * np.minimum(size[:, 2][:, None], size[:, 2][None])
    touching = (gap < 0.3) & level & (along > 0.3) & ~np.eye(len(centre), dtype=bool)
    off = np.hypot(*(centre[:, :2] - centre[:, :2].mean(axis=0)).T) if len(centre) else np.zeros(0)
    return {
        "parent_area": np.log(area),
        "parent_offcentre": off / max(off.mean(), 1e-6) if len(off) else off,
        "parent_touching": np.log(touching.sum(axis=1) / np.sqrt(area) + 0.5),
        "parent_tall": np.maximum(size[:, 2] - 3.2, 0),
        "parent_corridor": np.clip(long - 0.4, 0, 1.2) * np.clip((2.6 - narrow) / 0.8, 0, 1),
    }


def _share_of_forests(pairs: Ints, log_weight: Floats, *, rooms: int) -> Floats:
    """Return the share `[P]` of all rooted spanning forests that has each pair, either way round.

    A forest weighs the product of the weights of its edges; every root weighs 1. The weights
    `[2, P]` are of the first room of a pair through the second, and of the reverse.
    """
    child = np.concatenate([pairs[:, 0], pairs[:, 1]])
    parent = np.concatenate([pairs[:, 1], pairs[:, 0]])
    weight = np.exp(np.clip(log_weight, -15, 15)).ravel()
    laplacian = np.eye(rooms)
    np.add.at(laplacian, (child, child), weight)
    np.add.at(laplacian, (child, parent), -weight)
    inverse = np.linalg.inv(laplacian)
    share = weight * (inverse[child, child] - inverse[parent, child])
    return np.asarray(share.reshape(2, -1).sum(axis=0))


def _to_probability(share: Floats, slope: float, shift: float) -> Floats:
    """Return calibrated probabilities of shares of forests."""
    share = np.clip(share, 1e-5, 1 - 1e-5)
    return np.asarray(1 / (1 + np.exp(-slope * np.log(share / (1 - share)) - shift)))


def choose_pairs(
    pairs: Ints,
    probability: Floats,
    *,
    rooms: int,
    known: Collection[tuple[int, int]] = (),
    threshold: float = THRESHOLD,
) -> Bools:
    """Return which pairs connect `[P]`: those from `threshold` up, and all that are `known`.

    Also from `_JOIN` up, where they join parts that nothing more probable joins.
    """
    part = np.arange(rooms)
    for a, b in known:
        part[part == part[a]] = part[b]
    chosen = np.zeros(len(pairs), dtype=bool)
    for number in np.argsort(-np.round(probability, 9), kind="stable"):
        a, b = pairs[number]
        joins = part[a] != part[b] and probability[number] >= _JOIN
        chosen[number] = probability[number] >= threshold or joins or (int(a), int(b)) in known
        if chosen[number]:
            part[part == part[a]] = part[b]
    return chosen
