"""The probability of what is seen, against the sum over all true counts."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import binom

from bsg_models.belief.count_distribution import CountDistribution, poisson
from bsg_models.belief.thinning import log_seen

MOST = 250  # true counts that are summed over


def sum_over_true_counts(true: CountDistribution, seen: np.ndarray, share: float) -> np.ndarray:
    total = np.zeros(seen.shape)
    for count in range(MOST):
        probability = np.exp(true.log_probability(np.full(seen.shape, float(count))))
        total += probability * binom.pmf(seen, count, 1 - share)
    return total


@settings(max_examples=25, deadline=None)
@given(
    seed=st.integers(0, 2**32 - 1),
    tilts=st.integers(0, 3),
    parts=st.integers(1, 3),
    share=st.floats(0, 0.999),
)
def test_a_share_of_what_is_there_is_seen(seed: int, tilts: int, parts: int, share: float) -> None:
    rng = np.random.default_rng(seed)
    shape = (parts, 3, 4)
    true = CountDistribution(
        means=rng.gamma(1, 2, shape),
        dispersions=np.where(rng.random(shape) < 0.3, np.inf, 0.2 + rng.gamma(2, 1, shape)),
        weights=rng.dirichlet(np.ones(parts), size=(3, 4)).transpose(2, 0, 1),
        tilts=rng.normal(0, 1, (tilts, *shape)) if tilts else None,
    )
    seen = rng.integers(0, 5, (3, 4))
    found = np.exp(log_seen(true, seen, np.array([[share] * 3, [0.5, 0.1, 0.9]])))
    np.testing.assert_allclose(found[0], sum_over_true_counts(true, seen, share), atol=1e-5)
    for room, other in enumerate((0.5, 0.1, 0.9)):
        expected = sum_over_true_counts(true, seen, other)[room]
        np.testing.assert_allclose(found[1, room], expected, atol=1e-5)


def test_of_a_poisson_a_poisson_is_seen() -> None:
    found = log_seen(poisson(np.array([[4.0]])), np.array([[3]]), np.array([[0.25]]))
    assert found.shape == (1, 1, 1)
    assert np.exp(found[0, 0, 0]) == pytest.approx(3**3 * np.exp(-3) / 6, rel=1e-5)
