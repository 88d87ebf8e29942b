"""Intervals against SciPy's bootstrap, and by hand."""

from __future__ import annotations

from itertools import product

import numpy as np
import pytest

from bsg_data.arrays import Floats
from bsg_models.evaluation.bootstrap import (
    Bootstrap,
    Rule,
    average_seeds,
    estimate_value,
    weigh_buildings,
)

# One number for each of two seeds (rows) and three buildings (columns).
TABLE = np.array([[1.0, 4.0, 7.0], [3.0, 5.0, 13.0]])


def bootstrap_mean(values: Floats, *, resamples: int, seed: int = 0) -> Bootstrap:
    """Return the mean over buildings of one number each."""
    weights = weigh_buildings(len(values), resamples=resamples, seed=seed)
    means = values @ weights / weights.sum(axis=0)
    return Bootstrap({"mean": float(means[0])}, {"mean": means[1:]}, {"mean": len(values)})


def test_a_resample_is_buildings_with_replacement() -> None:
    weights = weigh_buildings(7, resamples=500, seed=0).T
    assert (weights[0] == 1).all()  # the data
    assert (weights.sum(axis=1) == 7).all()
    np.testing.assert_allclose(weights.mean(axis=0), 1, atol=0.15)
    assert weights[1:].var() == pytest.approx(1 - 1 / 7, abs=0.1)  # of a multinomial
    np.testing.assert_array_equal(weights[:4].T, weigh_buildings(7, resamples=3, seed=0))
    assert not np.array_equal(weights[:4].T, weigh_buildings(7, resamples=3, seed=1))


def test_percentiles_by_hand() -> None:
    resampled = np.arange(41.0)  # quantiles 0.025 and 0.975 are the second and the last but one
    plain = estimate_value(30.0, resampled, nodes=9, rule="percentile")
    assert (plain.value, plain.low, plain.high, plain.nodes) == (30.0, 1.0, 39.0, 9)
    centred = estimate_value(30.0, resampled, nodes=9)
    assert (centred.low, centred.high) == (30.0 + 1 - 20, 30.0 + 39 - 20)


@pytest.mark.parametrize("rule", ["centred", "percentile"])
def test_what_is_not_known_is_left_out(rule: Rule) -> None:
    nan = float("nan")
    known = estimate_value(1.0, np.array([0.0, 2.0]), nodes=1, rule=rule)
    holes = np.array([nan, 0.0, nan, 2.0])
    assert estimate_value(1.0, holes, nodes=1, rule=rule) == known
    for few in ([], [nan, 1.0]):
        none = estimate_value(1.0, np.array(few), nodes=1, rule=rule)
        assert np.isnan([none.low, none.high]).all()


def test_differences_and_ratios_are_paired() -> None:
    """Two models whose difference is the same in every building differ by it, for certain."""
    hard = np.array([1.0, 50.0, 7.0, 300.0])
    ours, other, double = (bootstrap_mean(v, resamples=40) for v in (hard, hard + 2, 2 * hard))
    gap = ours.difference(other, "mean")
    assert (gap.value, gap.low, gap.high) == pytest.approx((-2, -2, -2))
    ratio = double.ratio(ours, "mean")
    assert (ratio.value, ratio.low, ratio.high) == pytest.approx((2, 2, 2))
    apart = ours.estimate("mean")
    assert apart.high > other.estimate("mean").low  # unpaired intervals overlap by far


def train_twice(table: Floats, *, resamples: int) -> Bootstrap:
    """Return the mean over the buildings and two seeds of a number for each, `[2, B]`."""
    return average_seeds([bootstrap_mean(row, resamples=resamples) for row in table])


def test_resamples_of_two_seeds_and_three_buildings_by_brute_force() -> None:
    """Each of the 27 draws of buildings comes with each of the 4 draws of seeds, equally often."""
    every = [
        np.mean([TABLE[s, b] for s in seeds for b in buildings])
        for seeds in product(range(2), repeat=2)
        for buildings in product(range(3), repeat=3)
    ]
    found = train_twice(TABLE, resamples=20_000)
    assert found.point == {"mean": 5.5}
    drawn = found.resampled["mean"]
    values, times = np.unique(np.round(every, 9), return_counts=True)
    known, often = np.unique(np.round(drawn, 9), return_counts=True)
    np.testing.assert_allclose(known, values)
    np.testing.assert_allclose(often / len(drawn), times / len(every), atol=0.01)
    low, high = np.quantile(every, [0.025, 0.975]) - np.mean(every) + 5.5
    interval = found.estimate("mean")
    assert (interval.low, interval.high) == pytest.approx((low, high), abs=0.1)


def test_differences_are_paired_by_seeds() -> None:
    """A seed that is bad for both does not widen their difference; without seeds, it does."""
    ours, other = train_twice(TABLE, resamples=40), train_twice(TABLE + 2, resamples=40)
    gap = ours.difference(other, "mean")
    assert (gap.value, gap.low, gap.high) == pytest.approx((-2, -2, -2))
    unseeded = bootstrap_mean(TABLE.mean(axis=0), resamples=40)  # is trained once
    against = ours.difference(unseeded, "mean")
    assert against.low < against.value == 0 < against.high
