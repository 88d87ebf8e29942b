"""Define the distribution of the hidden counts: a finite mixture per node and class.

The components are negative binomials. One suffices for most models; latent room types and ensembles
need more. A component may be tilted: its tilts are log factors of its first counts
(`bsg_models.belief.negative_binomial`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import numpy.typing as npt
from scipy.special import gammaln, lambertw, logsumexp

from bsg_data.arrays import Floats
from bsg_models.belief.negative_binomial import TINY, first_counts, log_none

MIN_RATE = 1e-3  # no hidden object may be impossible: one log 0 would dominate any mean
_MOST_TILT = 600.0  # largest exponent computed: e^709 is the largest number


@dataclass(frozen=True, eq=False)
class CountDistribution:
    """Beliefs about the hidden counts of N nodes of interest and C classes.

    Attributes:
        means: `[K, N, C]` μ ≥ 0 of the K components.
        dispersions: `[K, N, C]` r > 0; ∞ for a Poisson.
        weights: `[K, N, 1]` or `[K, N, C]`; sums over K to 1.
        tilts: `[J, K, N, C]` log factors of the hidden counts 0..J−1, applied before each component
            is normalised; None for J = 0. With tilts, `means` are those of the untilted components.
    """

    means: Floats
    dispersions: Floats
    weights: Floats
    tilts: Floats | None = None

    @cached_property
    def mean(self) -> Floats:
        """Expected hidden counts λ, `[N, C]`."""
        return np.asarray((self.weights * self._moment(self.means, 1)).sum(axis=0))

    @property
    def variance(self) -> Floats:
        """Variance of the hidden counts, `[N, C]`."""
        second = self._moment(self.means + self.means**2 * (1 + 1 / self.dispersions), 2)
        return np.asarray((self.weights * second).sum(axis=0) - self.mean**2)

    def _moment(self, untilted: Floats, power: int) -> Floats:
        """Return E(count^power) of every component, `[K, N, C]`, from that of the untilted one."""
        if self.tilts is None:
            return untilted
        moment = untilted.copy()
        for count in range(1, len(self.tilts)):  # the tilt of count 0 adds nothing
            moment += count**power * self._first[count] * np.expm1(self.tilts[count])
        return np.asarray(np.maximum(moment, 0.0) * np.exp(-self._log_normaliser))

    @cached_property
    def _untilted_none(self) -> Floats:
        """Log P(0) of every component without tilts, `[K, N, C]`."""
        return _log_nones(self.means, self.dispersions)

    @cached_property
    def _first(self) -> list[Floats]:
        """The untilted probabilities of the counts 0..J−1, each `[K, N, C]`."""
        number = 0 if self.tilts is None else len(self.tilts)
        return _first_counts(number, np.exp(self._untilted_none), self.means, self.dispersions)

    @property
    def _log_none(self) -> Floats:
        """Log P(0) of every component, `[K, N, C]`."""
        if self.tilts is None:
            return self._untilted_none
        return np.asarray(self._untilted_none + self.tilts[0] - self._log_normaliser)

    @cached_property
    def _log_normaliser(self) -> Floats:
        if self.tilts is None:
            return np.zeros(self.means.shape)
        return _log_normaliser(self._first, self.tilts, self._untilted_none)

    @property
    def is_finite(self) -> bool:
        """Whether all parameters, and the values computed from them, are finite.

        A dispersion may be infinite, which is a Poisson. Finite parameters can still overflow.
        """
        parts = [self.weights, self.means, self.mean, self.presence]
        if self.tilts is not None:
            parts.append(self.tilts)
        return bool((self.dispersions > 0).all()) and all(np.isfinite(one).all() for one in parts)

    @cached_property
    def presence(self) -> Floats:
        """P(at least one hidden object of the class), `[N, C]`."""
        present = -np.expm1(np.minimum(self._log_none, 0.0))
        if len(present) > 1:
            present = self.weights * present
        # A count that is never there stays exactly 0, whatever its tilts.
        return np.where((self.means > 0).any(axis=0), present.sum(axis=0), 0.0)

    @property
    def log_odds_of_none(self) -> Floats:
        """Log P(0) − log P(at least one), `[N, C]`, clipped to ±20.7 (a presence of 1e-9)."""
        none = np.clip(1 - self.presence, 1e-9, 1 - 1e-9)
        return np.asarray(np.log(none) - np.log1p(-none))

    def log_probability(self, counts: Floats, *, floor: float = MIN_RATE) -> Floats:
        """Return log P(hidden = counts), `[N, C]`.

        Args:
            counts: `[N, C]` whole numbers.
            floor: lower bound of the means, before tilts.
        """
        means = np.maximum(self.means, floor)
        each = _log_nones(means, self.dispersions)
        normaliser: Floats | float = 0.0
        if self.tilts is not None:
            first = _first_counts(len(self.tilts), np.exp(each), means, self.dispersions)
            normaliser = _log_normaliser(first, self.tilts, each)
        some = counts > 0  # most counts are 0 and need nothing more
        some_r = np.broadcast_to(self.dispersions, means.shape)[:, some]
        each[:, some] += _log_beyond_nones(counts[some], means[:, some], some_r)
        if self.tilts is not None:
            each -= normaliser
            for count, tilt in enumerate(self.tilts):
                each += tilt * (counts == count)
        if len(each) == 1:
            return np.asarray(np.minimum(each[0], 0.0))
        with np.errstate(divide="ignore"):
            weighed = each + np.log(self.weights)
        return np.asarray(np.minimum(logsumexp(weighed, axis=0), 0.0))

    def quantile(self, q: float) -> npt.NDArray[np.int64]:
        """Return the q-quantile: the smallest count n with P(hidden ≤ n) of at least q.

        Args:
            q: from 0 to below 1.

        Returns:
            `[N, C]`.

        Raises:
            ValueError: if q is outside this range.
        """
        if not 0 <= q < 1:
            raise ValueError(f"q must be 0 to below 1, found {q}")
        return self._invert(np.full(self.means.shape[1:], q))

    def _invert(self, levels: Floats) -> npt.NDArray[np.int64]:
        """Return the smallest counts n with P(hidden ≤ n) of at least these levels, `[N, C]`."""
        counts = np.zeros(levels.shape, dtype=np.int64)
        below = np.zeros(levels.shape)
        count, waiting = 0, np.ones(levels.shape, dtype=bool)
        most = np.ceil(self.mean.max(initial=0) + 60 * np.sqrt(self.variance.max(initial=0))) + 1
        while waiting.any() and count <= most:
            below += np.exp(self.log_probability(np.full(levels.shape, float(count)), floor=0.0))
            counts[waiting] = count
            waiting &= below < levels - 1e-12
            count += 1
        return counts

    def sample(self, rng: np.random.Generator) -> npt.NDArray[np.int64]:
        """Sample all counts once, `[N, C]`; the building's count is not the sum of its rooms'."""
        chosen = np.empty(self.means.shape[1:], dtype=np.int64)
        level = rng.random((len(chosen), 1))
        shares = np.broadcast_to(np.cumsum(self.weights, axis=0), self.means.shape)
        np.minimum((shares < level).sum(axis=0), len(self.means) - 1, out=chosen)
        means, r = (
            np.take_along_axis(part, chosen[None], axis=0)[0]
            for part in (self.means, np.broadcast_to(self.dispersions, self.means.shape))
        )
        if self.tilts is not None:
            tilts = np.take_along_axis(self.tilts, chosen[None, None], axis=1)
            one = replace(negative_binomial(means, r), tilts=tilts)
            return one._invert(rng.random(chosen.shape))
        finite = np.isfinite(r)
        gamma = rng.gamma(np.where(finite, r, 1.0)) / np.where(finite, r, 1.0)
        return np.asarray(rng.poisson(np.where(finite, gamma, 1.0) * means))

    def take(self, rows: npt.NDArray[np.integer]) -> CountDistribution:
        """Return the distribution of some nodes, `rows` `[M]`."""
        return CountDistribution(
            self.means[:, rows],
            self.dispersions[:, rows],
            self.weights[:, rows],
            None if self.tilts is None else self.tilts[:, :, rows],
        )

    def take_classes(self, columns: npt.NDArray[np.integer]) -> CountDistribution:
        """Return the distribution of some classes of every node, `columns` `[N, A]`."""
        shape = (len(self.means), *columns.shape)
        means, dispersions, weights = (
            np.take_along_axis(
                np.broadcast_to(part, self.means.shape), np.broadcast_to(columns, shape), axis=2
            )
            for part in (self.means, self.dispersions, self.weights)
        )
        tilts = self.tilts
        if tilts is not None:
            everywhere = np.broadcast_to(columns, (*tilts.shape[:2], *columns.shape))
            tilts = np.take_along_axis(tilts, everywhere, axis=3)
        return CountDistribution(means, dispersions, weights, tilts)

    def recalibrated(self, *, shift: float, slope: float, spread: float) -> CountDistribution:
        """Return the distribution with means e^shift · μ^slope and dispersions e^spread · r.

        The means are those before tilts; the tilts stay as they are.
        """
        means = np.exp(shift) * self.means**slope
        return replace(self, means=means, dispersions=np.exp(spread) * self.dispersions)

    def with_none_likelier(self, log_factor: Floats) -> CountDistribution:
        """Return the distribution with the log odds of count 0 raised.

        All probabilities above 0 keep their ratios, also between components: each component is
        weighted by what is left of it.

        Args:
            log_factor: `[N, C]`, added to log P(0) − log P(at least one).
        """
        tilts = np.zeros((1, *self.means.shape)) if self.tilts is None else self.tilts.copy()
        tilts[0] += log_factor
        weights = self.weights
        if len(weights) > 1:
            gain = np.exp(self._log_none) * np.expm1(log_factor)
            weights = weights * np.maximum(1 + gain, TINY)
            weights = weights / weights.sum(axis=0)
        return replace(self, tilts=tilts, weights=weights)

    def without(self, known: npt.NDArray[np.bool_]) -> CountDistribution:
        """Return the distribution with nothing hidden in the cells `known` `[N, C]`."""
        tilts = None if self.tilts is None else self.tilts * ~known
        return replace(self, means=self.means * ~known, tilts=tilts)


def poisson(means: Floats) -> CountDistribution:
    """Return independent Poisson counts with these means `[N, C]`."""
    return negative_binomial(means, np.full_like(means, np.inf))


def negative_binomial(means: Floats, dispersions: Floats) -> CountDistribution:
    """Return independent negative binomials, means and dispersions `[N, C]`."""
    return CountDistribution(means[None], dispersions[None], np.ones((1, len(means), 1)))


def zero_inflated(presence: Floats, means: Floats) -> CountDistribution:
    """Return the zero-inflated Poisson with given P(at least one) and mean, both `[N, C]`.

    Its Poisson component μ has the mean m = mean / presence, given at least one. If the mean is too
    small for the presence, there are no zeros to add, and the result is the Poisson with that
    presence.
    """
    presence = np.clip(presence, 0.0, 1 - 1e-6)
    given = np.divide(means, presence, out=np.ones_like(means), where=presence > 0)
    least = -np.log1p(-presence)
    rate = np.maximum(_positive_poisson_rate(given), np.maximum(least, 1e-9))
    weight = np.minimum(presence / -np.expm1(-rate), 1.0)
    zero = np.zeros_like(rate)
    return CountDistribution(
        np.stack([zero, rate]), np.full((2, *rate.shape), np.inf), np.stack([1 - weight, weight])
    )


def _positive_poisson_rate(given: Floats) -> Floats:
    """Return the rates μ of Poissons from their means m given at least one; 0 for m ≤ 1.

    μ solves μ / (1 − e^−μ) = m: μ = m + W(−m e^−m), with W Lambert's function. Near m = 1, where W
    branches and SciPy's is inexact or NaN, the inverted series 2ε − ⅔ε² + 4/9 ε³ of ε = m − 1
    is exact to 4e-13.
    """
    near = given < 1 + 1e-3
    excess, far = np.where(near, np.maximum(given - 1, 0.0), 0.0), np.where(near, 2.0, given)
    series = excess * (2 - excess * (2 / 3 - excess * (4 / 9)))
    return np.where(near, series, far + lambertw(-far * np.exp(-far)).real)


def blend(
    distributions: Sequence[CountDistribution], weights: Sequence[float]
) -> CountDistribution:
    """Return the mixture of several distributions of the same nodes."""
    shape = distributions[0].means.shape[1:]
    scaled = [
        np.broadcast_to(distribution.weights * w, distribution.means.shape)
        for distribution, w in zip(distributions, weights, strict=True)
    ]
    if any(distribution.means.shape[1:] != shape for distribution in distributions):
        raise ValueError("expected distributions of the same nodes and classes")
    return CountDistribution(
        np.concatenate([distribution.means for distribution in distributions]),
        np.concatenate([distribution.dispersions for distribution in distributions]),
        np.concatenate(scaled),
        _join_tilts(distributions, axis=1),
    )


def concatenate(distributions: Sequence[CountDistribution]) -> CountDistribution:
    """Return the distributions of several batches of nodes as one of all nodes, in order."""
    return CountDistribution(
        np.concatenate([distribution.means for distribution in distributions], axis=1),
        np.concatenate([distribution.dispersions for distribution in distributions], axis=1),
        np.concatenate([distribution.weights for distribution in distributions], axis=1),
        _join_tilts(distributions, axis=2),
    )


def _join_tilts(distributions: Sequence[CountDistribution], *, axis: int) -> Floats | None:
    """Return the tilts of several distributions along an axis; missing tilts become zeros."""
    number = max(0 if one.tilts is None else len(one.tilts) for one in distributions)
    if not number:
        return None
    parts = []
    for one in distributions:
        tilts = np.zeros((number, *one.means.shape))
        if one.tilts is not None:
            tilts[: len(one.tilts)] = one.tilts
        parts.append(tilts)
    return np.concatenate(parts, axis=axis)


def _log_nones(mean: Floats, dispersion: Floats) -> Floats:
    """Return the untilted log P(0) of every component, `[K, N, C]`, including Poissons."""
    finite = np.isfinite(dispersion)
    if finite.all():
        return log_none(mean, dispersion)
    return np.where(finite, log_none(mean, np.where(finite, dispersion, 1.0)), -mean)


def _log_beyond_nones(counts: Floats, mean: Floats, dispersion: Floats) -> Floats:
    """Return log P(counts) − log P(0) of M cells with counts above 0, `[K, M]`."""
    finite = np.isfinite(dispersion)
    r = np.where(finite, dispersion, 1.0)
    with np.errstate(divide="ignore"):
        spread = np.where(finite, np.log(mean + r), 0.0)
        power = counts * (np.log(mean) - spread)
    choose = np.where(finite, gammaln(counts + r) - gammaln(r), 0.0)
    return np.asarray(choose - gammaln(counts + 1) + power)


def _first_counts(number: int, none: Floats, mean: Floats, dispersion: Floats) -> list[Floats]:
    """Return the untilted P(0), …, P(number − 1) of every component, including Poissons."""
    if number < 2 or np.isfinite(dispersion).all():
        return first_counts(number, none, mean, dispersion)
    probabilities = [none]
    with np.errstate(invalid="ignore"):
        for count in range(number - 1):
            step = mean * (dispersion + count) / ((mean + dispersion) * (count + 1))
            step = np.where(np.isfinite(dispersion), step, mean / (count + 1))
            probabilities.append(probabilities[-1] * step)
    return probabilities


def _log_normaliser(first: Sequence[Floats], tilts: Floats, log_none: Floats) -> Floats:
    """Return log Z of every component, `[K, N, C]`.

    Args:
        first: its untilted first counts.
        tilts: of them.
        log_none: log of the first count's probability. In a large building that probability
            underflows, and its tilt overflows.
    """
    large = tilts[0] > _MOST_TILT
    rest = [np.where(large, 0.0, tilts[0]), *tilts[1:]]
    gained = sum(p * np.expm1(tilt) for p, tilt in zip(first, rest, strict=True))
    if large.any():
        gained = gained + large * np.exp(np.where(large, log_none + tilts[0], 0.0))
    return np.asarray(np.log(np.maximum(1 + gained, TINY)))
