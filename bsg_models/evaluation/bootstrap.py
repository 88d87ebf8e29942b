"""Bootstrap over buildings: values, differences and ratios with 95 % intervals.

The bootstrap samples buildings, because draws of one building are not independent. A resample draws
as many buildings as there are, with replacement, which gives each building a weight. Everything
that is compared uses the same resamples, and a difference or ratio is computed in each. So
buildings that are hard for both sides do not widen its interval. If models were trained by several
seeds, a resample draws seeds, too (`average_seeds`).

There are two rules for the ends of an interval:

- `percentile`: the 2.5 % and 97.5 % quantiles of the resampled values. Searches use it: a saving is
  a ratio of two sums, and its resamples lie around its value.
- `centred`: the same quantiles, shifted so that the mean of the resampled values falls on the
  value. Metrics use it: resamples repeat buildings, which adds noise, and noise can only increase a
  norm such as Frobenius'. So its resamples lie above its value.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Floats

Rule = Literal["centred", "percentile"]
LEAST_BUILDINGS = 5  # with fewer, a bootstrap says nothing


@dataclass(frozen=True, slots=True)
class Estimate:
    """A value with its 95 % interval over buildings, and over seeds if there are several."""

    value: float  # nan if it is not defined
    low: float  # lower end; nan without an interval
    high: float  # upper end; nan without an interval
    nodes: int  # number of nodes, or of searches, behind the value

    def show(self, digits: int = 3) -> str:
        """Return the value and half the width of its interval; – if it is not defined.

        >>> Estimate(0.1234, 0.11, 0.15, nodes=9).show()
        '0.123 ±0.02'
        """
        if np.isnan(self.value):
            return "–"
        value, half = f"{self.value:.{digits}g}", (self.high - self.low) / 2
        return value if np.isnan(half) else f"{value} ±{half:.{digits - 2}g}"

    def encode(self) -> dict[str, float | int | None]:
        """Return the estimate for JSON; unknown numbers are null."""
        ends = {"value": self.value, "low": self.low, "high": self.high}
        known = {end: None if np.isnan(number) else number for end, number in ends.items()}
        return {**known, "nodes": self.nodes}


@dataclass(frozen=True, eq=False)
class Bootstrap:
    """A model's metrics, with their values on every resample of the buildings, and of the seeds."""

    point: dict[str, float]  # metric → value
    resampled: dict[str, Floats]  # metric → `[resamples]`
    nodes: dict[str, int]  # metric → number of nodes behind it

    def estimates(self) -> dict[str, Estimate]:
        """Return every metric with its interval."""
        return {name: self.estimate(name) for name in self.point}

    def estimate(self, name: str) -> Estimate:
        """Return one metric with its interval."""
        return estimate_value(self.point[name], self.resampled[name], nodes=self.nodes[name])

    def difference(self, other: Bootstrap, name: str) -> Estimate:
        """Return this model's metric minus another's, with the interval of the difference."""
        value = self.point[name] - other.point[name]
        resampled = self.resampled[name] - other.resampled[name]
        return estimate_value(value, resampled, nodes=self.nodes[name])

    def ratio(self, other: Bootstrap, name: str) -> Estimate:
        """Return this model's metric over another's, with the interval of the ratio."""
        value = self.point[name] / other.point[name]
        resampled = self.resampled[name] / other.resampled[name]
        return estimate_value(value, resampled, nodes=self.nodes[name])


def weigh_buildings(buildings: int, *, resamples: int, seed: int) -> npt.NDArray[np.uint16]:
    """Return how often each building counts in the data and in each resample, `[buildings, 1 + R]`.

    The first column is the data. The weights depend only on the arguments, so all models get the
    same resamples.

    >>> weigh_buildings(3, resamples=2, seed=0).sum(axis=0).tolist()
    [3, 3, 3]
    """
    rng = np.random.Generator(np.random.PCG64(seed))
    shares = np.full(buildings, 1 / buildings)
    weights = np.ones((buildings, 1 + max(resamples, 0)), dtype=np.uint16)
    for column in range(1, weights.shape[1]):
        weights[:, column] = rng.multinomial(buildings, shares)
    return weights


def average_seeds(trained: Sequence[Bootstrap], *, seed: int = 0) -> Bootstrap:
    """Return the mean over trainings by S seeds, resampled over buildings and seeds together.

    With v(s, r) the value of seed s on the buildings of resample r, and r = 0 all buildings:

        value         Σ_s v(s, 0) / S
        resample r    Σ_i v(d(r, i), r) / S,  i = 1 … S, each d(r, i) one of the S seeds at random

    Buildings and seeds are crossed, so each is drawn with replacement, independently of the other:
    the pigeonhole bootstrap (Owen, Annals of Applied Statistics 1, 2007, doi:10.1214/07-AOAS122).
    The draws depend only on S, the number of resamples and `seed`. So all models of S seeds get the
    same ones, and their differences are paired by buildings and by seeds.

    A few seeds show less than their spread: on average, the variance due to seeds is (S − 1) / S of
    what it should be, half with two seeds and two thirds with three.

    Args:
        trained: `[S]` the same model by each seed, on the same resamples of the buildings.
        seed: of the draws.

    >>> two = [Bootstrap({"x": x}, {"x": np.array([x])}, {"x": 1}) for x in (1.0, 2.0)]
    >>> average_seeds(two).point
    {'x': 1.5}
    """
    first, number = trained[0], len(trained)
    resamples = len(next(iter(first.resampled.values())))
    # The same seed draws the buildings; jumped far ahead, its numbers are others.
    rng = np.random.Generator(np.random.PCG64(seed).jumped())
    drawn = rng.integers(number, size=(resamples, number))
    resampled = {}
    for name in first.resampled:
        values = np.stack([model.resampled[name] for model in trained], axis=1)
        resampled[name] = np.take_along_axis(values, drawn, axis=1).mean(axis=1)
    return Bootstrap(
        point={
            name: float(np.mean([model.point[name] for model in trained])) for name in first.point
        },
        resampled=resampled,
        nodes=first.nodes,
    )


def estimate_value(
    value: float, resampled: Floats, *, nodes: int, rule: Rule = "centred"
) -> Estimate:
    """Return a value with the interval of its resampled values.

    Args:
        value: over all buildings.
        resampled: `[resamples]`; nan values are left out; fewer than 2 others give no interval.
        nodes: number behind the value.
        rule: for the ends, see the module.

    >>> estimate_value(5.0, np.array([0.0, 2.0]), nodes=3, rule="percentile")
    Estimate(value=5.0, low=0.05, high=1.95, nodes=3)
    """
    known = resampled[~np.isnan(resampled)]
    if len(known) < 2:
        return Estimate(float(value), float("nan"), float("nan"), nodes)
    low, high = np.quantile(known, [0.025, 0.975])
    if rule == "centred":
        mean = known.mean()
        low, high = value + (low - mean), value + (high - mean)
    return Estimate(float(value), float(low), float(high), nodes)
