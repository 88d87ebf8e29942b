"""Intervals against SciPy's bootstrap and a naive loop, and by hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from scipy import stats

from bsg_data.arrays import Floats
from bsg_models.evaluation.bootstrap import (
    Bootstrap,
    bootstrap,
    estimate_value,
    resample_buildings,
)


@dataclass(frozen=True)
class Means:
    """The mean over buildings of some numbers, and their weighted mean of squares."""

    values: tuple[float, ...]

    @property
    def scene_ids(self) -> tuple[str, ...]:
        return tuple(str(value) for value in self.values)

    def evaluate(self, building_weights: Floats | None = None) -> dict[str, float]:
        weights = np.ones(len(self.values)) if building_weights is None else building_weights
        values = np.array(self.values)
        return {
            "mean": float(weights @ values / weights.sum()),
            "square": float(weights @ values**2 / weights.sum()),
        }

    def count_nodes(self, metric: str) -> int:
        return len(self.values) if metric == "mean" else 1


def test_a_resample_is_buildings_with_replacement() -> None:
    weights = resample_buildings(7, resamples=500, seed=0)
    assert weights.shape == (500, 7)
    assert (weights.sum(axis=1) == 7).all()
    assert (weights == weights.round()).all()
    np.testing.assert_allclose(weights.mean(axis=0), 1, atol=0.15)
    assert weights.var() == pytest.approx(1 - 1 / 7, abs=0.1)  # of a multinomial
    np.testing.assert_array_equal(weights[:3], resample_buildings(7, resamples=3, seed=0))
    assert not np.array_equal(weights[:3], resample_buildings(7, resamples=3, seed=1))
    assert resample_buildings(7, resamples=-1, seed=0).shape == (0, 7)


def test_percentiles_by_hand() -> None:
    resampled = np.arange(41.0)  # quantiles 0.025 and 0.975 are the second and the last but one
    plain = estimate_value(30.0, resampled, nodes=9, rule="percentile")
    assert (plain.value, plain.low, plain.high, plain.nodes) == (30.0, 1.0, 39.0, 9)
    centred = estimate_value(30.0, resampled, nodes=9)
    assert (centred.low, centred.high) == (30.0 + 1 - 20, 30.0 + 39 - 20)


@pytest.mark.parametrize("rule", ["centred", "percentile"])
def test_what_is_not_known_is_left_out(rule: str) -> None:
    nan = float("nan")
    known = estimate_value(1.0, np.array([0.0, 2.0]), nodes=1, rule=rule)  # type: ignore[arg-type]
    holes = np.array([nan, 0.0, nan, 2.0])
    assert estimate_value(1.0, holes, nodes=1, rule=rule) == known  # type: ignore[arg-type]
    for few in ([], [1.0], [nan, nan], [nan, 1.0]):
        none = estimate_value(1.0, np.array(few), nodes=1, rule=rule)  # type: ignore[arg-type]
        assert np.isnan([none.low, none.high]).all()


def test_intervals_are_scipys() -> None:
    """The two are of other random numbers, and agree within what these make them differ."""
    values = np.random.default_rng(0).normal(3, 2, 60)
    ours = bootstrap(Means(tuple(values)), resamples=4000, seed=1).estimate("mean")
    theirs = stats.bootstrap(
        (values,), np.mean, method="percentile", n_resamples=4000, rng=np.random.default_rng(2)
    ).confidence_interval
    assert ours.value == pytest.approx(values.mean())
    assert ours.low == pytest.approx(theirs.low, abs=0.05)
    assert ours.high == pytest.approx(theirs.high, abs=0.05)


def test_intervals_are_those_of_a_naive_loop() -> None:
    values = np.array([1.0, 4.0, 9.0, 2.0])
    measured = bootstrap(Means(tuple(values)), resamples=50, seed=3)
    rng = np.random.Generator(np.random.PCG64(3))
    sampled = []
    for _ in range(50):
        times = rng.multinomial(4, np.full(4, 1 / 4))
        sampled.append(np.repeat(values, times).mean())
    np.testing.assert_allclose(measured.resampled["mean"], sampled)
    low, high = np.quantile(sampled, [0.025, 0.975])
    estimate = measured.estimate("mean")
    assert estimate.low == pytest.approx(4 + low - np.mean(sampled))
    assert estimate.high == pytest.approx(4 + high - np.mean(sampled))
    assert estimate.nodes == 4
    assert measured.estimates()["square"].nodes == 1


def test_differences_and_ratios_are_paired() -> None:
    """Two models whose difference is the same in every building differ by it, for certain."""
    hard = (1.0, 50.0, 7.0, 300.0)
    ours, other, double = (
        bootstrap(Means(values), resamples=40)
        for values in (hard, tuple(v + 2 for v in hard), tuple(2 * v for v in hard))
    )
    gap = ours.difference(other, "mean")
    assert (gap.value, gap.low, gap.high) == pytest.approx((-2, -2, -2))
    ratio = double.ratio(ours, "mean")
    assert (ratio.value, ratio.low, ratio.high) == pytest.approx((2, 2, 2))
    apart = ours.estimate("mean")
    assert apart.high > other.estimate("mean").low  # unpaired intervals overlap by far


def test_no_resamples_no_interval_and_progress() -> None:
    steps: list[tuple[int, int]] = []
    bootstrap(Means((1.0, 2.0)), resamples=3, progress=lambda *step: steps.append(step))
    assert steps == [(1, 3), (2, 3), (3, 3)]
    nothing = bootstrap(Means((1.0, 2.0)), resamples=0)
    assert nothing.estimate("mean").value == 1.5
    assert np.isnan(nothing.estimate("mean").low)
    assert isinstance(nothing, Bootstrap)
