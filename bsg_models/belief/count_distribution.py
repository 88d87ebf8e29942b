"""Define the distribution of the hidden counts: a finite mixture per node and class.

Means, presences and calibrations are also computed of tensors of torch, for files of other programs
(`bsg_models.training.onnx_file`).

The components are negative binomials. One suffices for most models; latent room types and ensembles
need more. A component may be tilted: its tilts are log factors of its first counts
(`bsg_models.belief.negative_binomial`).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Counts, Floats
from bsg_models.arrays import library_of, take_columns
from bsg_models.belief.negative_binomial import (
    POISSON,
    TINY,
    log_counts,
    log_none,
    log_seen,
    none_seen,
    rising_slope,
    tilt_gains,
)
from bsg_models.special_functions import log_sum_exp

MIN_RATE = 1e-3  # no hidden object may be impossible: one log 0 would dominate any mean


@dataclass(frozen=True, eq=False)
class CountDistribution:
    """Beliefs about the hidden counts of N nodes of interest and C classes.

    Attributes:
        means: `[K, N, C]` μ ≥ 0 of the K components.
        dispersions: `[K, N, C]` r > 0; ∞ for a Poisson, which becomes `POISSON`.
        weights: `[K, N, 1]` or `[K, N, C]`; sums over K to 1.
        tilts: `[J, K, N, C]` log factors of the hidden counts 0..J−1, applied before each component
            is normalised; None for J = 0. With tilts, `means` are those of the untilted components.
    """

    means: Floats
    dispersions: Floats
    weights: Floats
    tilts: Floats | None = None

    def __post_init__(self) -> None:
        object.__setattr__(self, "dispersions", self.dispersions.clip(max=POISSON))

    @cached_property
    def mean(self) -> Floats:
        """Expected hidden counts λ, `[N, C]`."""
        mean: Floats = (self.weights * self._moment(self.means, 1)).sum(axis=0)
        return mean

    @property
    def variance(self) -> Floats:
        """Variance of the hidden counts, `[N, C]`."""
        second = self._moment(self.means + self.means**2 * (1 + 1 / self.dispersions), 2)
        variance: Floats = (self.weights * second).sum(axis=0) - self.mean**2
        return variance

    def _moment(self, untilted: Floats, power: int) -> Floats:
        """Return E(count^power) of every component, `[K, N, C]`, from that of the untilted one."""
        if self.tilts is None:
            return untilted
        moment = untilted
        for count, gain in enumerate(self._gains[1:], 1):  # the tilt of count 0 adds nothing
            moment = moment + count**power * gain
        tilted: Floats = moment.clip(min=0.0) / self._normaliser
        return tilted

    @cached_property
    def _log_none(self) -> Floats:
        """Log P(0) of every component, `[K, N, C]`."""
        none = self._untilted_none
        if self.tilts is None:
            return none
        log_none: Floats = none + self.tilts[0] - library_of(none).log(self._normaliser)
        return log_none

    @cached_property
    def _untilted_none(self) -> Floats:
        return log_none(self.means, self.dispersions)

    @cached_property
    def _gains(self) -> list[Floats]:
        """What tilts add to the probabilities of the first counts, each `[K, N, C]`."""
        tilts = () if self.tilts is None else self.tilts
        return tilt_gains(tilts, self.means, self.dispersions, none=self._untilted_none)

    @cached_property
    def _normaliser(self) -> Floats:
        total: Floats = (1 + sum(self._gains)).clip(min=TINY)  # type: ignore[union-attr]
        return total

    @property
    def is_finite(self) -> bool:
        """Whether all parameters, and what is computed from them, are finite (it may overflow)."""
        # A mean depends on all of them, but on dispersions with tilts only.
        return bool((self.dispersions > 0).all() and np.isfinite(self.mean).all())

    @cached_property
    def presence(self) -> Floats:
        """P(at least one hidden object of the class), `[N, C]`."""
        xp = library_of(self.means)
        present = -xp.expm1(self._log_none.clip(max=0.0))
        if len(present) > 1:
            present = self.weights * present  # weights sum to 1 up to rounding
        # A count that is never there stays exactly 0, whatever its tilts.
        is_possible = (self.means > 0).any(axis=0)
        presence: Floats = xp.where(is_possible, present.sum(axis=0).clip(max=1.0), 0.0)
        return presence

    def log_probability(self, counts: Floats, *, floor: float = MIN_RATE) -> Floats:
        """Return log P(hidden = counts), `[N, C]`; `floor` bounds the means before tilts."""
        return self._floored(floor)._log_each(counts)[1]

    def _floored(self, floor: float) -> CountDistribution:
        return replace(self, means=np.maximum(self.means, floor))

    @np.errstate(divide="ignore")
    def _log_each(self, counts: Floats) -> tuple[Floats, Floats]:
        """Return log (weight · P(counts)) of every component, `[K, N, C]`, and log P, `[N, C]`."""
        log_p = self._untilted_none + np.log(self.weights)
        tilts: Any = ()
        if self.tilts is not None:
            log_p, tilts = log_p - np.log(self._normaliser), self.tilts
        positive = np.flatnonzero(counts)
        each: Floats = log_counts(
            log_p, counts, positive, self.means, self._whole_dispersions, tilts
        )
        return each, np.minimum(log_sum_exp(each, axis=0), 0.0)

    @property
    def _whole_dispersions(self) -> Floats:
        """Dispersions in the shape of the means."""
        return np.broadcast_to(self.dispersions, self.means.shape)

    def log_probability_slopes(self, counts: Floats) -> tuple[Floats, Floats, Floats]:
        """Return log P(counts) `[N, C]`, and its derivatives by log μ and log r, `[K, N, C]`.

        Of log Σ_k w_k p_k they are those of log p_k, times the share of k in the sum. Those are
        r (h − E) / (μ + r) by log μ, with E the mean of the component, and by log r

            r (ψ(r + h) − ψ(r)) + (log NB(0) − Σ_t NB(t) (e^a_t − 1) r (ψ(r + t) − ψ(r))) / Z

        less that. A mean below the floor has no slope.
        """
        floored, positive = self._floored(MIN_RATE), counts > 0
        each, log_p = floored._log_each(counts)
        by_mean = floored.dispersions * (counts - floored._moment(floored.means, 1))
        by_mean /= floored.means + floored.dispersions
        by_dispersion = floored._untilted_none - sum(
            gain * rising_slope(count, floored.dispersions)
            for count, gain in enumerate(floored._gains)
        )
        if floored.tilts is not None:
            by_dispersion /= floored._normaliser
        by_dispersion -= by_mean
        by_dispersion[:, positive] += rising_slope(
            counts[positive], floored._whole_dispersions[:, positive]
        )
        by_mean *= self.means > MIN_RATE
        if len(each) == 1:
            return log_p, by_mean, by_dispersion
        share = np.exp(each - log_p)
        return log_p, share * by_mean, share * by_dispersion

    def log_seen(self, seen: Counts, shares: Floats) -> Floats:
        """Return log P(V = seen) at several hidden shares, `[S, N, C]`, of these *true* counts T.

        Each object is hidden independently with probability s, `shares` `[S, N]` below 1, so that
        V ~ NB((1 − s) μ, r), and with tilts P(V = v) = NB_V(v) Z_v / Z.
        """
        true = self._floored(MIN_RATE)
        share = shares[:, None, :, None]
        none = none_seen(share, true.means, true.dispersions, true._gains)  # [S, K, N, C]
        log_p: Floats = np.log(np.maximum((none * true.weights).sum(axis=1), TINY))
        node, column = np.nonzero(seen)
        some, counts = true.take(node).take_classes(column[:, None]), seen[node, column][:, None]
        each: Floats = log_seen(counts, share[:, :, node], some.means, some.dispersions, some.tilts)
        with np.errstate(divide="ignore"):
            log_p[:, node, column] = log_sum_exp(each + np.log(some.weights), axis=1)[..., 0]
        return log_p

    def quantile(self, q: float) -> npt.NDArray[np.int64]:
        """Return the smallest count n with P(hidden ≤ n) of at least q, `[N, C]`; q is below 1."""
        if not 0 <= q < 1:
            raise ValueError(f"q must be 0 to below 1, found {q}")
        counts = np.zeros(self.means.shape[1:], dtype=np.int64)
        below, waiting = np.zeros(counts.shape), np.ones(counts.shape, dtype=bool)
        last = np.ceil(self.mean.max(initial=0) + 60 * np.sqrt(self.variance.max(initial=0))) + 1
        count = 0
        while waiting.any() and count <= last:
            below += np.exp(self.log_probability(np.full(counts.shape, float(count)), floor=0.0))
            counts[waiting] = count
            waiting &= below < q - 1e-12
            count += 1
        return counts

    def _each(
        self, choose: Callable[[Floats], Floats], *, weights: Floats | None = None
    ) -> CountDistribution:
        """Return what is chosen of every array, and of other weights than its own."""
        chosen = CountDistribution(
            choose(self.means),
            choose(self.dispersions),
            choose(self.weights if weights is None else weights),
            None if self.tilts is None else choose(self.tilts),
        )
        if "_gains" in vars(self):  # what was computed of the components is chosen alike
            none, gains = choose(self._untilted_none), [choose(gain) for gain in self._gains]
            vars(chosen).update(_untilted_none=none, _gains=gains)
        return chosen

    def take(self, rows: npt.NDArray[np.integer]) -> CountDistribution:
        """Return the distribution of some nodes `[M]`."""
        return self._each(lambda part: part[..., rows, :])

    def take_classes(self, columns: npt.NDArray[np.integer]) -> CountDistribution:
        """Return the distribution of some classes of every node, `columns` `[N, A]`."""
        return self._each(lambda part: take_columns(part, columns))

    def recalibrated(self, calibration: Floats) -> CountDistribution:
        """Return it with untilted means e^shift · μ^slope and dispersions e^spread · r.

        The calibration `[3]` is shift, logarithm of the slope, and spread.
        """
        shift, log_slope, spread = calibration.tolist()
        means = math.exp(shift) * self.means ** float(np.exp(log_slope))
        return replace(self, means=means, dispersions=math.exp(spread) * self.dispersions)

    def with_none_likelier(self, log_factor: Floats) -> CountDistribution:
        """Return it with `log_factor` `[N, C]` added to log P(0) − log P(at least one).

        All probabilities above 0 keep their ratios, also between components: each component is
        weighted by what is left of it.
        """
        xp = library_of(self.means)
        tilts = xp.zeros_like(self.means)[None] if self.tilts is None else self.tilts
        tilts = xp.concatenate([tilts[:1] + log_factor, tilts[1:]])
        weights = self.weights
        if len(weights) > 1:
            gain = xp.exp(self._log_none) * xp.expm1(log_factor)
            weights = weights * (1 + gain).clip(min=TINY)
            weights = weights / weights.sum(axis=0)
        after = replace(self, tilts=tilts, weights=weights)
        none = self._untilted_none  # it stays, as all gains but the first do
        first = tilt_gains(tilts[:1], self.means, self.dispersions, none=none)
        vars(after).update(_untilted_none=none, _gains=first + self._gains[1:])
        return after

    def miss(self, chance: Floats) -> Floats:
        """Return P(a look finds none), `[N, C]`, if it finds each object with a `chance` `[N, C]`.

        It is E[(1 − chance)^H]. A factor s^h turns a negative binomial of mean μ into one of mean
        r s μ / (r + (1 − s) μ), and leaves r and the tilts.
        """
        missed: Floats = self._miss_each(chance)[1].sum(axis=0).clip(0.0, 1.0)
        return missed

    def missed(self, chance: Floats) -> CountDistribution:
        """Return the distribution after a look that found none; see `miss`.

        It is Bayes' rule: P(H = h | none found) ∝ P(H = h) (1 − chance)^h.
        """
        after, weights = self._miss_each(chance)
        return replace(after, weights=weights / weights.sum(axis=0).clip(min=TINY))

    def _miss_each(self, chance: Floats) -> tuple[CountDistribution, Floats]:
        """Return the components after a look that found none, and the weight of each times P."""
        missed = 1 - chance
        means = missed * self.means * self.dispersions
        means = means / (self.dispersions + chance * self.means)
        after = replace(self, means=means)
        log_p = self._untilted_none - after._untilted_none
        if self.tilts is not None:
            log_p = log_p + np.log(after._normaliser) - np.log(self._normaliser)
        return after, self.weights * np.exp(log_p)

    def without(self, known: npt.NDArray[np.bool_]) -> CountDistribution:
        """Return the distribution with nothing hidden in the cells `known` `[N, C]`."""
        if isinstance(known, np.ndarray) and not known.any():
            return self
        tilts = None if self.tilts is None else self.tilts * ~known
        return replace(self, means=self.means * ~known, tilts=tilts)


def poisson(means: Floats) -> CountDistribution:
    """Return independent Poisson counts with these means `[N, C]`."""
    return negative_binomial(means, np.full_like(means, POISSON))


def negative_binomial(means: Floats, dispersions: Floats) -> CountDistribution:
    """Return independent negative binomials, means and dispersions `[N, C]`."""
    return CountDistribution(means[None], dispersions[None], np.ones((1, len(means), 1)))


def zero_inflated(presence: Floats, means: Floats) -> CountDistribution:
    """Return the zero-inflated Poisson with given P(at least one) and mean, both `[N, C]`.

    Its Poisson has the mean m = mean / presence, given at least one. If the mean is too small for
    the presence, there are no zeros to add: the result is the Poisson with that presence.
    """
    presence = np.clip(presence, 0.0, 1 - 1e-6)
    given = np.divide(means, presence, out=np.ones_like(means), where=presence > 0)
    least = -np.log1p(-presence)
    rate = np.maximum(_positive_poisson_rate(given), np.maximum(least, 1e-9))
    weight = np.minimum(presence / -np.expm1(-rate), 1.0)
    means = np.stack([np.zeros_like(rate), rate])
    return CountDistribution(means, np.full_like(means, POISSON), np.stack([1 - weight, weight]))


def _positive_poisson_rate(given: Floats) -> Floats:
    """Return the rates μ of Poissons from their means m given at least one; 0 for m ≤ 1.

    μ solves μ / (1 − e^−μ) = m: μ = m + W(−m e^−m), with W Lambert's function. Near m = 1, where W
    branches and SciPy's is inexact or NaN, the inverted series 2ε − ⅔ε² + 4/9 ε³ of ε = m − 1
    is exact to 4e-13.
    """
    from scipy.special import lambertw  # slow to import, and no shipped model needs it

    near = given < 1 + 1e-3
    excess, far = np.where(near, np.maximum(given - 1, 0.0), 0.0), np.where(near, 2.0, given)
    series = excess * (2 - excess * (2 / 3 - excess * (4 / 9)))
    return np.where(near, series, far + lambertw(-far * np.exp(-far)).real)


def blend(
    distributions: Sequence[CountDistribution], weights: Sequence[float]
) -> CountDistribution:
    """Return the mixture of distributions of the same nodes."""
    scaled = [
        replace(
            part,
            weights=np.broadcast_to(part.weights * weight, part.means.shape),
        )
        for part, weight in zip(distributions, weights, strict=True)
    ]
    return _join(scaled, axis=-3)


def blend_copies(distribution: CountDistribution, weights: Floats) -> CountDistribution:
    """Return the mixture, by weights `[L]`, of L consecutive copies of N nodes."""

    def fold(part: Floats) -> Floats:
        apart = part.reshape(*part.shape[:-2], len(weights), -1, part.shape[-1])
        return apart.reshape(*part.shape[:-3], -1, *apart.shape[-2:])

    of_copy = np.repeat(weights, len(distribution.means[0]) // len(weights))[:, None]
    return distribution._each(fold, weights=distribution.weights * of_copy)


def concatenate(distributions: Sequence[CountDistribution]) -> CountDistribution:
    """Return the distributions of several batches of nodes as one, in order."""
    return _join(distributions, axis=-2)


def _join(distributions: Sequence[CountDistribution], *, axis: int) -> CountDistribution:
    """Join distributions along the axis of components (−3) or nodes (−2)."""
    number = max(0 if part.tilts is None else len(part.tilts) for part in distributions)
    means, dispersions, weights = (
        np.concatenate([getattr(part, name) for part in distributions], axis=axis)
        for name in ("means", "dispersions", "weights")
    )
    tilts = []
    for part in distributions:
        tilts.append(np.zeros((number, *part.means.shape)))
        if part.tilts is not None:
            tilts[-1][: len(part.tilts)] = part.tilts
    joined = np.concatenate(tilts, axis=axis) if number else None
    return CountDistribution(means, dispersions, weights, joined)
