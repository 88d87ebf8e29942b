from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bsg_models.expectation import MIN_RATE, Expectation, from_hidden, from_totals

INPUTS = np.array([[2.0, 0.0, 1.0]])
HIDDEN = np.array([[0.5, 3.0, 0.0]])
COUNTS = np.array([[1.0, 4.0, 0.0]])


def test_totals_below_the_input_hide_nothing() -> None:
    found = from_totals(INPUTS, np.array([[1.0, 3.0, 1.5]]))
    assert found.hidden.tolist() == [[0.0, 3.0, 0.5]]
    assert found.expected.tolist() == [[2.0, 3.0, 1.5]]
    assert found.totals.tolist() == [[1.0, 3.0, 1.5]]


def test_poisson_is_scipys() -> None:
    found = from_hidden(INPUTS, HIDDEN)
    expected = stats.poisson.logpmf(COUNTS, np.maximum(HIDDEN, MIN_RATE))
    np.testing.assert_allclose(found.log_probability(COUNTS), expected)
    np.testing.assert_allclose(found.presence, 1 - np.exp(-HIDDEN))


def test_negative_binomial_is_scipys() -> None:
    r = np.array([[0.7, 2.0, 5.0]])
    found = from_hidden(INPUTS, HIDDEN, r)
    rate = np.maximum(HIDDEN, MIN_RATE)
    expected = stats.nbinom.logpmf(COUNTS, r, r / (r + rate))
    np.testing.assert_allclose(found.log_probability(COUNTS), expected)
    law = stats.nbinom(r, r / (r + HIDDEN))
    np.testing.assert_allclose(found.presence, 1 - law.pmf(0))
    np.testing.assert_allclose(law.mean(), HIDDEN)


def test_a_large_dispersion_is_a_poisson() -> None:
    poisson = from_hidden(INPUTS, HIDDEN)
    almost = from_hidden(INPUTS, HIDDEN, np.full((1, 3), 1e9))
    np.testing.assert_allclose(almost.presence, poisson.presence, atol=1e-8)


@pytest.mark.parametrize("dispersion", [None, np.full((1, 3), 2.0)])
def test_an_impossible_object_costs_a_finite_amount(dispersion: np.ndarray | None) -> None:
    found = Expectation(INPUTS, np.zeros((1, 3)), INPUTS, dispersion)
    assert np.isfinite(found.log_probability(COUNTS)).all()
    assert found.presence.tolist() == [[0.0, 0.0, 0.0]]
