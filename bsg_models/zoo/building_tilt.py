"""Tilt what buildings hide: a home has one kitchen, so its rooms are not independent.

Let q be P(none is hidden in a room), and P the product of q over the rooms: P(none is hidden in the
building), if rooms were independent. A tilt a multiplies P by exp(a), before P(none) and P(at least
one) are normalised. So the log odds of none of the building become ℓ + a. Those of a room follow:
the others hide none with P / q, and

    log(q / (1 − q))  becomes  log(q / (1 − q)) + log(1 + (exp(a) − 1) P / q)

If a home surely has a refrigerator (a < 0), the rooms that are left expect it; if its refrigerator
was seen (a > 0), they expect no second. The tilt is linear in ℓ, with a bend where models are sure:

    a = shift + slope ℓ + bend max(0, −1 − ℓ)

Shift and slope are of the class, the bend is one for all. There are other numbers for classes of
which one was seen in the building than for the others.

It mends two errors. Models are too sure what a room is that nobody has labelled. And they are too
sure of what annotators leave out: a kitchen of HM3D has a stove in four of five cases. The second
is in data of known sources alone. So any other building gets the tilt by the share of its rooms
that have no label.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.observation.observation import Observation
from bsg_data.scene.surroundings import UNKNOWN
from bsg_models.arrays import Array, library_of
from bsg_models.belief.negative_binomial import TINY

if TYPE_CHECKING:
    from bsg_data.observation.masked_buildings import MaskedBuildings

_SURE = 12.0  # log odds beyond which all are alike
_BEND = 1.0  # log odds of at least one from which the bend counts
_SURELY = 1e-12  # least P(none)
_FEW = 1e-6  # rooms that hide something with less say nothing of a tilt
_HALVINGS = 60  # of an interval, to the last digit
# Weights of the prior, in log-likelihoods of buildings, of a number that is off by 1.
_OF_SHIFT, _OF_SLOPE, _OF_LINE = 1.0, 2.0, 0.1


def log_none_of(presence: Array) -> Array:
    """Return log q of P(at least one)."""
    return library_of(presence).log((1 - presence).clip(min=_SURELY))


def share_to_tilt(seen: Observation, *, reads_labels: bool) -> Floats:
    """Return the share of the tilt that B buildings get, `[B, 1]`, from a model."""
    if not reads_labels:
        return np.ones((len(seen), 1))
    around, first = seen.surroundings, seen.starts[:-1]
    unlabelled = ~seen.is_building & (around.labels.sum(axis=1) == 0)
    rooms = np.maximum(np.diff(seen.starts) - 1, 1)
    share = np.add.reduceat(unlabelled.astype(float), first) / rooms
    return np.where(around.sources == UNKNOWN, share, 1.0)[:, None]


def _tilt_buildings(log_none: Array, seen: Array, line: Array) -> Array:
    """Return the tilts a of B buildings, `[B, A]`.

    Args:
        log_none: `[B, A]` log P of independent rooms, for A classes.
        seen: `[B, A]` whether one of the class was seen in the building.
        line: `[2, 3, B, A]`, or broadcast: shift, slope and bend of classes not seen, and seen.
    """
    xp = library_of(log_none)
    odds = log_odds(log_none)
    bent = _bend(odds)
    unseen, again = (shift + slope * odds + bend * bent for shift, slope, bend in line)
    return xp.where(seen, again, unseen) * (log_none < 0)  # none without rooms


def tilt_rooms(tilts: Array, log_none: Array, others: Array) -> Array:
    """Return what tilts of buildings add to the log odds of none of rooms, `[M, A]`.

    Args:
        tilts: `[M, A]` of the building of each room.
        log_none: `[M, A]` log P of the building.
        others: `[M, A]` log q of the room, which is left out of it.
    """
    xp = library_of(tilts)
    return xp.log((1 + xp.exp(log_none - others) * xp.expm1(tilts)).clip(min=TINY))


def tilt(
    presence: Array, building: Array, seen: Array, line: Array, share: Array
) -> tuple[Array, Array, Array]:
    """Return tilts and log P of B buildings, `[B, A]`, and what tilts add to rooms, `[M, A]`.

    Args:
        presence: `[M, A]` of independent rooms.
        building: `[M]` of each room.
        seen: `[B, A]` whether one of the class was seen in the building.
        line: as of `_tilt_buildings`.
        share: `[B, 1]` of the tilt that each building gets.
    """
    none = log_none_of(presence)
    log_none = _sum_by_building(none, building, len(seen))
    tilts = _tilt_buildings(log_none, seen, line) * share
    return tilts, log_none, tilt_rooms(tilts[building], log_none[building], none)


def untilt(rooms: Floats, whole: Floats) -> Floats:
    """Return Z, `[A]`, by which a tilt divided P(at least one) of a building and of its rooms.

    Z = 1 + (exp(a) − 1) P. So 1 − Π (1 − Z p) of the rooms is Z p of the building. The left side by
    Z falls from Σ p to the largest p, at Z = 1 / p. One room alone fits any Z; it is 1.

    Args:
        rooms: `[R, A]` p of rooms.
        whole: `[A]` p of the building: from the largest of the rooms to their sum.
    """
    low = np.zeros_like(whole)
    high = (1 - _SURELY) / rooms.max(axis=0, initial=0.0).clip(min=_SURELY)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        more = -np.expm1(np.log1p(-middle * rooms).sum(axis=0)) > middle * whole
        low, high = np.where(more, middle, low), np.where(more, high, middle)
    return np.where((rooms > _FEW).sum(axis=0) > 1, (low + high) / 2, 1.0)


def _sum_by_building(values: Array, building: Array, number: int) -> Array:
    """Return the sums over rooms `[M, A]` of each of some buildings, `[number, A]`."""
    if not isinstance(values, np.ndarray):  # of torch: a file of another program asks of one
        return values.sum(axis=0, keepdims=True)
    sums = np.zeros((number, values.shape[1]))
    if len(values):
        first = np.flatnonzero(np.diff(building, prepend=-1))
        sums[building[first]] = np.add.reduceat(values, first)
    return sums


def fit_building_tilt(presence: Floats, masked: MaskedBuildings, share: Floats) -> Floats:
    """Return the lines `[2, 3, C]` that maximise the likelihood of what buildings hide.

    It is a logistic regression of whether a building hides none. Masks of one building count as
    one. A prior holds shift and slope of each class to those of all, and these to 0.

    Args:
        presence: `[N, C]` of the nodes of masked buildings; rows of buildings are not used.
        masked: the buildings; a class that a building cannot hide, or not name, does not count.
        share: `[B, 1]` of the tilt that each building gets.
    """
    seen = masked.seen
    rooms = ~seen.is_building
    log_none = _sum_by_building(log_none_of(presence[rooms]), seen.building[rooms], len(seen))
    hidden = _sum_by_building(masked.hidden[rooms].astype(float), seen.building[rooms], len(seen))
    first = seen.starts[:-1]
    _, place = np.unique(seen.scene_ids, return_inverse=True)
    weight = 1 / np.bincount(place)[place]
    counts = masked.known[first] & (log_none < 0)
    lines = np.zeros((2, 3, log_none.shape[1]))
    for line, own in zip(lines, (seen.inputs[first] == 0, seen.inputs[first] > 0), strict=True):
        row, column = np.nonzero(counts & own)
        odds, none = log_odds(log_none[row, column]), hidden[row, column] == 0
        parts = share[row, 0] * np.stack([np.ones_like(odds), odds, _bend(odds)])
        line[:] = _fit_line(
            odds, none, parts, column=column, weight=weight[row], classes=line.shape[1]
        )
    return lines


def _fit_line(
    odds: Floats, none: Bools, parts: Floats, *, column: Ints, weight: Floats, classes: int
) -> Floats:
    """Return the line `[3, C]` of cells `[K]` of one state; a tilt is a sum of parts `[3, K]`."""
    from scipy.sparse import csr_array, hstack  # only trainings come here

    cells, shape = np.arange(len(odds)), (len(odds), classes)
    own = [csr_array((part, (cells, column)), shape=shape) for part in parts[:2]]
    design = hstack([*own, csr_array(parts.T)], format="csr")
    prior = np.repeat([_OF_SHIFT, _OF_SLOPE, _OF_LINE], [classes, classes, 3])
    fitted = fit_odds(odds, none, design, prior=prior, weight=weight)
    line = np.tile(fitted[2 * classes :, None], classes)
    line[:2] += fitted[: 2 * classes].reshape(2, classes)
    return line


def fit_odds(
    odds: Floats,
    none: Bools,
    design: Any,
    *,
    prior: Floats,
    weight: Floats | float = 1.0,
    limit: float | None = None,
) -> Floats:
    """Return the numbers b `[P]` that make `none` `[K]` likeliest: a logistic regression.

    Args:
        odds: `[K]` log odds of none, to which `design` @ b is added.
        none: `[K]` whether there was none.
        design: `[K, P]`, dense or sparse.
        prior: `[P]` weights of b², in log-likelihoods of cells.
        weight: `[K]` of the cells.
        limit: of the numbers.
    """

    def cost(numbers: Floats) -> tuple[float, Floats]:
        mended = odds + design @ numbers
        loss = weight * (np.logaddexp(0.0, mended) - none * mended)
        slope = weight * (1 / (1 + np.exp(-mended)) - none)
        gradient = design.T @ slope + 2 * prior * numbers
        return float(loss.sum() + prior @ numbers**2), gradient

    from scipy.optimize import minimize  # only trainings come here

    bounds = None if limit is None else [(-limit, limit)] * len(prior)
    start = np.zeros(len(prior))
    return np.asarray(minimize(cost, start, jac=True, method="L-BFGS-B", bounds=bounds).x)


def log_odds(log_p: Array, *, limit: float = _SURE) -> Array:
    """Return the log odds of probabilities by their logarithms, from −limit to limit."""
    xp = library_of(log_p)
    odds: Array = log_p - xp.log((-xp.expm1(log_p)).clip(min=TINY))
    return odds.clip(-limit, limit)


def _bend(odds: Array) -> Array:
    bent: Array = (-_BEND - odds).clip(min=0.0)
    return bent
