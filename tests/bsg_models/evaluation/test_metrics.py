"""Every metric against SciPy or a naive loop, and by hand."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from scipy import stats

from bsg_data.arrays import Floats
from bsg_models.evaluation import metrics

counts = hnp.arrays(np.float64, (4, 6), elements=st.integers(0, 9).map(float))


@given(counts, counts)
def test_value_distances_are_scipys(a: Floats, b: Floats) -> None:
    p, q = metrics.normalise(a), metrics.normalise(b)
    for found, reference in (
        (metrics.wasserstein_values(p, q), stats.wasserstein_distance),
        (metrics.energy_values(p, q), stats.energy_distance),
    ):
        expected = [reference(x, y) for x, y in zip(p, q, strict=True)]
        np.testing.assert_allclose(found, expected, atol=1e-9)


def test_the_papers_distances_cannot_tell_one_class_from_another() -> None:
    """The true histogram with its classes permuted scores 0: docs/results/reproduction.md."""
    rng = np.random.default_rng(0)
    true = metrics.normalise(rng.poisson(0.5, (20, 45)).astype(float))
    permuted = true[:, rng.permutation(45)]
    assert metrics.wasserstein_values(permuted, true).max() == 0
    assert metrics.energy_values(permuted, true).max() == pytest.approx(0)
    assert metrics.total_variation(permuted, true).mean() > 0.5


@given(
    hnp.arrays(np.float64, 8, elements=st.integers(-4, 4).map(float)),
    hnp.arrays(np.float64, 8, elements=st.integers(0, 3).map(float)),
    st.sampled_from([0.0, 1.5]),
)
def test_moments_are_scipys_of_repeated_values(
    values: Floats, times: Floats, centre: float
) -> None:
    sums = (times[:, None] * (values - centre)[:, None] ** np.arange(5)).sum(axis=0)
    mean, variance, skewness, kurtosis = (
        float(one[0]) for one in metrics.moments_of_sums(sums[None], centre=centre)
    )
    repeated = np.repeat(values, times.astype(int))
    if not len(repeated):
        assert np.isnan(mean)
        return
    assert mean == pytest.approx(repeated.mean())
    assert variance == pytest.approx(repeated.var(), abs=1e-12)
    if np.ptp(repeated):
        assert skewness == pytest.approx(stats.skew(repeated), abs=1e-9)
        assert kurtosis == pytest.approx(stats.kurtosis(repeated), abs=1e-9)
    else:
        assert np.isnan(skewness)


@given(hnp.arrays(np.float64, (7, 5), elements=st.integers(0, 5).map(float)))
def test_correlations_are_numpys_where_they_exist(table: Floats) -> None:
    found = metrics.correlation_matrix(table)
    varying = table.std(axis=0) > 0
    if varying.sum() > 1:
        expected = np.corrcoef(table[:, varying], rowvar=False)
        np.testing.assert_allclose(found[np.ix_(varying, varying)], expected, atol=1e-9)
    assert (np.diag(found) == 1).all()
    constant = np.flatnonzero(~varying)
    assert (np.delete(found[constant], constant, axis=1) == 0).all()


@pytest.mark.parametrize(
    ("k", "hits"), [(1, [0, np.nan, 0]), (2, [1, np.nan, 0]), (3, [1, np.nan, 1])]
)
def test_top_k_by_hand(k: int, hits: list[float]) -> None:
    presence = np.array([[0.9, 0.6, 0.6, 0.1]] * 3)
    seen = np.array([[True, False, False, False]] * 3)
    hidden = np.array(
        [[True, False, True, False], [True, False, False, False], [False, False, False, True]]
    )
    # class 0 is seen and does not compete; classes 1 and 2 tie, and the lower index goes first
    found = metrics.topk_unseen(presence, seen, hidden, k=k)
    assert np.array_equal(found, hits, equal_nan=True)
