"""The special functions of answers against SciPy's."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy import special

from bsg_models.special_functions import (
    beta_quantiles,
    gauss_legendre,
    log_gamma,
    log_sum_exp,
)


def test_log_gamma_is_scipys() -> None:
    values = np.concatenate([np.logspace(-9, 25, 2000), np.linspace(0.01, 60, 2000)])
    np.testing.assert_allclose(log_gamma(values), special.gammaln(values), rtol=1e-12, atol=1e-12)


@given(st.lists(st.floats(-2, 6), min_size=1, max_size=4), st.lists(st.floats(-2, 6), min_size=4))
def test_quantiles_of_beta_distributions_are_scipys(left: list[float], right: list[float]) -> None:
    """From nearly two points to nearly one."""
    a, b = 10.0 ** np.array(left), 10.0 ** np.array(right[: len(left)])
    probabilities = (1 + gauss_legendre(8)[0]) / 2
    found = beta_quantiles(a, b, probabilities=probabilities)
    assert found.shape == (8, len(a))
    expected = special.betaincinv(a, b, probabilities[:, None])
    np.testing.assert_allclose(found, expected, atol=1e-6)


@pytest.mark.parametrize("axis", [0, 1])
def test_sums_of_exponentials_are_scipys(axis: int) -> None:
    values = np.array([[-1e5, -1e5 + 1, 3.0], [-np.inf, -np.inf, 700.0], [-np.inf, 1e5, 0.0]])
    for keepdims in (True, False):
        found = log_sum_exp(values, axis=axis, keepdims=keepdims)
        np.testing.assert_allclose(found, special.logsumexp(values, axis=axis, keepdims=keepdims))
    assert np.isneginf(log_sum_exp(np.full((2, 1), -np.inf), axis=0)).all()
