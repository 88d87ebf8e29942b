"""Fit room types to the counts of rooms: by expectation maximisation, or by the rooms' labels.

Each round computes P(type | room), sums over the rooms what each type holds (`_Sums`), and fits the
types to these sums. Most counts are 0, and a round takes time and memory for the others.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats, Ints
from bsg_models.belief.negative_binomial import (
    first_counts,
    log_negative_binomial,
    log_none,
    log_normaliser,
)
from bsg_models.special_functions import log_sum_exp
from bsg_models.zoo.hand_prior import HandPrior

if TYPE_CHECKING:
    from scipy.sparse import csr_array

Rooms = npt.NDArray[np.integer]  # counts `[R, C]`, of any width
MOST = 60  # the fit treats larger counts of a class in a room as this
MISSING = MOST + 1  # count of a class that the room's source has no word for: it says nothing
_LOG_SHAPE = 4.0  # limit of |log r|, whose prior is a standard normal
_PRIOR_ROOMS = 2.0  # weight of the mean room in every type's means, in rooms
_TILT_ROOMS = 40.0  # weight of no tilt in every type's tilts, in rooms
_MOST_TILT = 5.0
# Of types that have names. Their weights are in rooms.
_TABLE_ROOMS = 50.0  # of the table, in each type; chosen on the homes of docs/results/transfer.md
_OWN_ROOMS = 20.0  # of a usual room, in how many a type has of a class
_USUAL_ROOMS = 10.0  # of the rooms that were read, in a usual room
_ONE_MORE = 0.2  # how much rarer one more of a class is, before any room was read
_NAMED_ROUNDS = 30


@dataclass(frozen=True, eq=False)
class FittedTypes:
    """The result of expectation maximisation, with K types and C classes."""

    log_types: Floats  # log π [K]
    means: Floats  # m [K, C], before tilts
    dispersions: Floats  # r [K, C]
    tilts: Floats  # [J, K, C]

    @property
    def expected(self) -> Floats:
        """Mean counts with tilts, `[K, C]`."""
        return tilted_means(self.means, self.dispersions, self.tilts)

    def weigh(self, counts: Rooms) -> tuple[Floats, Floats]:
        """Return P(type | room) `[R, K]` and log P(room) `[R]` of rooms `[R, C]`, up to `MOST`."""
        width = max(int(counts.max(initial=0)) + 1, len(self.tilts), 2)
        return self.weigh_marked(_mark(counts, width), width)

    def weigh_marked(self, marked: csr_array, width: int) -> tuple[Floats, Floats]:
        """Return the same of rooms as `_mark` returns them."""
        table = self.tabulate(width)
        none = table[..., 0]
        beyond = (table[..., 1:] - none[..., None]).reshape(len(table), -1)
        log_joint = self.log_types + none.sum(axis=1) + marked @ beyond.T
        log_room = log_sum_exp(log_joint, axis=1, keepdims=True)
        return np.exp(log_joint - log_room), log_room[:, 0]

    def tabulate(self, width: int) -> Floats:
        """Return the log probabilities of the counts 0 to `width` − 1, `[K, C, width]`."""
        values, tilted = np.arange(width), len(self.tilts)
        table = log_negative_binomial(values, self.means[..., None], self.dispersions[..., None])
        table[..., :tilted] += np.moveaxis(self.tilts, 0, -1)
        table -= log_normaliser(self.tilts, self.means, self.dispersions)[..., None]
        table[..., MISSING:] = 0
        return table


@dataclass(frozen=True, eq=False)
class _Sums:
    """What expectation maximisation needs of the rooms."""

    size: Floats  # [K] number of rooms of each type
    frequency: Floats  # [K, C, values] number of those rooms with each count


def fit_types(
    counts: Rooms,
    *,
    types: int,
    iterations: int,
    seed: int,
    tilted: int = 0,
) -> FittedTypes:
    """Fit a mixture of tilted negative binomials to complete rooms by expectation maximisation.

    Each round fits the negative binomials as if there were no tilts, then the tilts to the rest.
    That is not exactly the maximum of the likelihood. But both steps are in closed form or nearly
    so, and neither overfits a rare type to a few rooms. The counts `[R, C]` are up to `MOST`. The
    seed is that of the start, in which rooms are grouped around K random ones.
    """
    width = max(int(counts.max(initial=0)) + 1, tilted, 2)
    points, marked = np.where(counts == MISSING, 0, counts), _mark(counts, width)
    membership = _group(np.log1p(points.astype(np.float64)), types, seed=seed)
    shape = (types, counts.shape[1])
    dispersions, tilts = np.ones(shape), np.zeros((tilted, *shape))
    fitted = _fit_sums(_sum_rooms(marked, membership, width), dispersions, tilts)
    for _ in range(1, iterations):
        sums = _sum_rooms(marked, fitted.weigh_marked(marked, width)[0], width)
        fitted = _fit_sums(sums, fitted.dispersions, fitted.tilts)
    return fitted


def fit_named_types(
    counts: Rooms, labels: Floats, table: HandPrior, *, tilted: int = 0
) -> FittedTypes:
    """Fit a tilted negative binomial to what the rooms of each label hold; K is L.

    The table, written by hand, counts as `_TABLE_ROOMS` rooms of each label. It says whether a room
    has a class, and how usual the label is. How many such a room has is as in the rooms `[R, C]` of
    the label `[R, L]`, and as in a usual room where these are few.
    """
    width = max(int(counts.max(initial=0)) + 1, tilted, 3)
    sums = _sum_rooms(_mark(counts, width), labels, width)
    found = sums.frequency[..., 1:MISSING]
    size = np.maximum(sums.frequency[..., :MISSING].sum(axis=2, keepdims=True), 1)
    usual = _USUAL_ROOMS * np.tensordot(table.usual, found / size, 1)
    usual = _divide(usual + _ONE_MORE ** np.arange(found.shape[2]))
    of_table = table.presence[..., None] * _divide(found + _OWN_ROOMS * usual)
    sums.frequency[..., 0] += _TABLE_ROOMS * (1 - table.presence)
    found += _TABLE_ROOMS * of_table
    dispersions = np.ones(table.presence.shape)
    tilts = np.zeros((tilted, *dispersions.shape))
    for _ in range(_NAMED_ROUNDS):
        fitted = _fit_sums(sums, dispersions, tilts, prior_rooms=0, tilt_rooms=1)
        dispersions, tilts = fitted.dispersions, fitted.tilts
    return replace(fitted, log_types=np.log(table.usual))


def _divide(values: Floats) -> Floats:
    """Return values divided by their sums over the last axis."""
    return np.asarray(values / values.sum(axis=-1, keepdims=True))


def _group(points: Floats, groups: int, *, seed: int) -> Floats:
    """Return soft memberships `[R, K]` after ten rounds of k-means from random points."""
    rng = np.random.Generator(np.random.PCG64(seed))
    centres = points[rng.choice(len(points), groups, replace=len(points) < groups)]
    for _ in range(10):
        distance = ((points**2).sum(1)[:, None] - 2 * points @ centres.T) + (centres**2).sum(1)
        nearest = distance.argmin(axis=1)
        for group in np.unique(nearest):
            centres[group] = points[nearest == group].mean(axis=0)
    return np.asarray(0.9 * np.eye(groups)[nearest] + 0.1 / groups)


def _mark(rooms: Rooms, width: int) -> csr_array:
    """Return which count each class has in each room, `[R, C · (width − 1)]`, counts above 0 only.

    With one row per room and one column per (class, count), sums over rooms become matrix products.
    """
    from scipy.sparse import csr_array  # only trainings come here

    rows, classes = np.nonzero(rooms)
    columns = classes * (width - 1) + rooms[rows, classes].astype(np.int64) - 1
    starts = np.searchsorted(rows, np.arange(len(rooms) + 1))
    shape = (len(rooms), rooms.shape[1] * (width - 1))
    return csr_array((np.ones(len(rows)), columns, starts), shape=shape)


def _sum_rooms(marked: csr_array, membership: Floats, width: int) -> _Sums:
    """Return the sums of rooms with given memberships in the types, `[R, K]`."""
    size = membership.sum(axis=0)
    beyond = (marked.T @ membership).T.reshape(len(size), -1, width - 1)
    none = np.maximum(size[:, None] - beyond.sum(axis=2), 0.0)
    return _Sums(size, np.concatenate([none[..., None], beyond], axis=2))


def _fit_sums(
    sums: _Sums,
    dispersions: Floats,
    tilts: Floats,
    *,
    prior_rooms: float = _PRIOR_ROOMS,
    tilt_rooms: float = _TILT_ROOMS,
) -> FittedTypes:
    """Return the types that fit sums over rooms; dispersions start from the previous ones."""
    frequency = sums.frequency[..., :MISSING]
    log_types = np.log((sums.size + 1) / (sums.size.sum() + len(sums.size)))
    size, rooms = sums.size[:, None], sums.size.sum()
    if sums.frequency.shape[2] > MISSING or not prior_rooms:
        size = frequency.sum(axis=2)  # [K, C] of the rooms that can name the class
        rooms = np.maximum(size.sum(axis=0), 1)
    values = np.arange(frequency.shape[2])
    totals = frequency @ values
    overall = np.maximum(totals.sum(axis=0) / rooms, 0.5 / rooms)
    means = (totals + prior_rooms * overall) / (size + prior_rooms)
    dispersions = _improve_dispersions(dispersions, means, frequency, values)
    table = log_negative_binomial(values, means[..., None], dispersions[..., None])
    tilts = _fit_tilts(table, frequency, len(tilts), tilt_rooms)
    return FittedTypes(log_types, means, dispersions, tilts)


def _improve_dispersions(r: Floats, mean: Floats, frequency: Floats, values: Ints) -> Floats:
    """Return dispersions `[K, C]` after Newton steps in log r on the weighted likelihood."""
    for _ in range(3):
        s, m = r[..., None], mean[..., None]
        steps = 1 / (s + values[:-1])  # their sums are the differences of the digamma function
        first = _sum_before(steps) - np.log1p(m / s) + (m - values) / (m + s)
        second = m / (s * (m + s)) - _sum_before(steps**2) - (m - values) / (m + s) ** 2
        slope = (frequency * first).sum(axis=-1) * r
        bend = (frequency * second).sum(axis=-1) * r**2 + slope
        log_r = np.log(r)
        slope, bend = slope - log_r, np.where(bend < 0, bend, -np.abs(bend)) - 1  # the prior
        r = np.exp(np.clip(log_r - np.clip(slope / bend, -1, 1), -_LOG_SHAPE, _LOG_SHAPE))
    return r


def _sum_before(steps: Floats) -> Floats:
    """Return 0 and the running sums over the last axis: `[..., n]` to `[..., n + 1]`."""
    sums = np.cumsum(steps, axis=-1)
    return np.concatenate([np.zeros_like(sums, shape=(*sums.shape[:-1], 1)), sums], axis=-1)


def _fit_tilts(table: Floats, frequency: Floats, tilted: int, rooms: float) -> Floats:
    """Return the tilts `[J, K, C]` that give the first counts their shares of the rooms.

    The shares are shrunk towards those without tilts, with the weight of some `rooms`. The
    `table` `[K, C, values]` has the log probabilities of the counts without tilts.
    """
    first = np.exp(table[..., :tilted])
    beyond = np.maximum(1 - first.sum(axis=-1), 1e-9)
    weights = frequency[..., :tilted] + rooms * first
    remaining = frequency[..., tilted:].sum(axis=-1) + rooms * beyond
    gain = np.log(weights / first) - np.log(remaining / beyond)[..., None]
    return np.moveaxis(np.clip(gain, -_MOST_TILT, _MOST_TILT), -1, 0)


def tilted_means(means: Floats, dispersions: Floats, tilts: Floats | None) -> Floats:
    """Return the means of tilted negative binomials; the first axis of `tilts` is the counts."""
    if tilts is None or not len(tilts):
        return means
    first = first_counts(len(tilts), np.exp(log_none(means, dispersions)), means, dispersions)
    gained = sum(t * p * np.expm1(a) for t, (p, a) in enumerate(zip(first, tilts, strict=True)))
    return np.asarray((means + gained) * np.exp(-log_normaliser(tilts, means, dispersions)))
