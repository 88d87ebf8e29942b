from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import stats

from bsg_models.belief.count_distribution import (
    MIN_RATE,
    CountDistribution,
    blend,
    concatenate,
    negative_binomial,
    poisson,
    zero_inflated,
)

MEANS = np.array([[0.5, 3.0, 0.0]])
SPREAD = np.array([[0.7, 2.0, 5.0]])
COUNTS = np.array([[1.0, 4.0, 0.0]])


def test_poisson_is_scipys() -> None:
    distribution = poisson(MEANS)
    expected = stats.poisson.logpmf(COUNTS, np.maximum(MEANS, MIN_RATE))
    np.testing.assert_allclose(distribution.log_probability(COUNTS), expected)
    np.testing.assert_allclose(distribution.presence, 1 - np.exp(-MEANS))
    np.testing.assert_allclose(distribution.variance, MEANS)


def test_negative_binomial_is_scipys() -> None:
    distribution = negative_binomial(MEANS, SPREAD)
    rate = np.maximum(MEANS, MIN_RATE)
    expected = stats.nbinom.logpmf(COUNTS, SPREAD, SPREAD / (SPREAD + rate))
    np.testing.assert_allclose(distribution.log_probability(COUNTS), expected)
    reference = stats.nbinom(SPREAD, SPREAD / (SPREAD + MEANS))
    np.testing.assert_allclose(distribution.presence, 1 - reference.pmf(0))
    np.testing.assert_allclose(distribution.mean, reference.mean())
    np.testing.assert_allclose(distribution.variance, reference.var())


def test_a_large_dispersion_is_a_poisson() -> None:
    almost = negative_binomial(MEANS, np.full((1, 3), 1e9))
    np.testing.assert_allclose(almost.presence, poisson(MEANS).presence, atol=1e-8)


@pytest.mark.parametrize("spread", [np.inf, 2.0])
def test_an_impossible_object_costs_a_finite_amount(spread: float) -> None:
    distribution = negative_binomial(np.zeros((1, 3)), np.full((1, 3), spread))
    assert np.isfinite(distribution.log_probability(COUNTS)).all()
    assert distribution.presence.tolist() == [[0.0, 0.0, 0.0]]


def mixture() -> CountDistribution:
    distributions = [
        negative_binomial(MEANS, SPREAD),
        poisson(MEANS + 1),
        poisson(np.zeros((1, 3))),
    ]
    return blend(distributions, [0.5, 0.3, 0.2])


def test_a_blend_is_the_weighted_sum_of_its_distributions() -> None:
    counts = np.arange(200.0)
    for c in range(3):
        first = stats.nbinom(SPREAD[0, c], SPREAD[0, c] / (SPREAD[0, c] + MEANS[0, c])).pmf(counts)
        second = stats.poisson(MEANS[0, c] + 1).pmf(counts)
        expected = 0.5 * first + 0.3 * second + 0.2 * (counts == 0)
        distribution = mixture()
        found = [
            np.exp(distribution.log_probability(np.full((1, 3), n), floor=0.0))[0, c]
            for n in counts[:20]
        ]
        np.testing.assert_allclose(found, expected[:20], atol=1e-12)
        assert distribution.presence[0, c] == pytest.approx(1 - expected[0])
        mean = expected @ counts
        assert distribution.mean[0, c] == pytest.approx(mean)
        assert distribution.variance[0, c] == pytest.approx(expected @ counts**2 - mean**2)


@pytest.mark.parametrize("q", [0.0, 0.05, 0.5, 0.9, 0.999])
def test_quantiles_are_scipys(q: float) -> None:
    found = negative_binomial(MEANS, SPREAD).quantile(q)
    distribution = stats.nbinom(SPREAD, SPREAD / (SPREAD + MEANS))
    assert found.tolist() == np.maximum(distribution.ppf(q), 0).astype(int).tolist()


def test_a_quantile_of_one_is_refused() -> None:
    with pytest.raises(ValueError, match="0 to below 1"):
        poisson(MEANS).quantile(1.0)


@given(presence=st.floats(1e-6, 0.9999), excess=st.floats(1.001, 50.0))
def test_a_zero_inflated_poisson_has_the_presence_and_mean_that_it_was_given(
    presence: float, excess: float
) -> None:
    """Always the presence; the mean too, unless even a plain Poisson of that presence has more."""
    distribution = zero_inflated(np.array([[presence]]), np.array([[presence * excess]]))
    assert distribution.presence[0, 0] == pytest.approx(presence, rel=1e-6)
    least = -np.log1p(-presence)
    assert distribution.mean[0, 0] == pytest.approx(max(presence * excess, least), rel=1e-4)
    assert 0 <= distribution.weights[1, 0, 0] <= 1


def test_nothing_present_is_a_distribution() -> None:
    distribution = zero_inflated(np.zeros((1, 2)), np.zeros((1, 2)))
    assert distribution.presence.tolist() == [[0.0, 0.0]]
    assert np.isfinite(distribution.log_probability(np.ones((1, 2)))).all()


def test_taking_rows_undoes_concatenating() -> None:
    first, second = poisson(MEANS), poisson(MEANS + 1)
    both = concatenate([first, second])
    np.testing.assert_array_equal(both.take(np.array([1])).mean, second.mean)
    np.testing.assert_array_equal(both.take(np.array([0])).mean, first.mean)


def test_recalibration_by_hand() -> None:
    distribution = negative_binomial(np.array([[4.0]]), np.array([[3.0]]))
    mended = distribution.recalibrated(shift=np.log(2), slope=0.5, spread=np.log(3))
    assert mended.mean[0, 0] == pytest.approx(4.0)  # 2 · √4
    assert mended.dispersions[0, 0, 0] == pytest.approx(9.0)
    same = distribution.recalibrated(shift=0.0, slope=1.0, spread=0.0)
    assert (same.mean, same.dispersions) == (distribution.mean, distribution.dispersions)
