"""Intervals against SciPy's bootstrap, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bsg_data.arrays import Floats
from bsg_models.evaluation.bootstrap import Bootstrap, Rule, estimate_value, weigh_buildings


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


def test_intervals_are_scipys() -> None:
    """The two are of other random numbers, and agree within what these make them differ."""
    values = np.random.default_rng(0).normal(3, 2, 60)
    ours = bootstrap_mean(values, resamples=4000, seed=1).estimate("mean")
    theirs = stats.bootstrap(
        (values,), np.mean, method="percentile", n_resamples=4000, rng=np.random.default_rng(2)
    ).confidence_interval
    assert ours.value == pytest.approx(values.mean())
    assert ours.low == pytest.approx(theirs.low, abs=0.05)
    assert ours.high == pytest.approx(theirs.high, abs=0.05)


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
