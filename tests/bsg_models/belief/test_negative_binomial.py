"""The negative binomial beside SciPy's, and its posterior beside simulation."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy import stats

from bsg_models.belief.negative_binomial import (
    first_counts,
    hidden_posterior,
    hidden_tilts,
    log_beyond_none,
    log_likelihood,
    log_negative_binomial,
    log_none,
    log_normaliser,
)

RNG = np.random.default_rng(0)
COUNTS = RNG.poisson(2.0, 50)
MEANS, DISPERSIONS = RNG.gamma(2.0, 1.0, 50), RNG.gamma(2.0, 2.0, 50)


def test_it_is_scipys() -> None:
    expected = stats.nbinom.logpmf(COUNTS, DISPERSIONS, DISPERSIONS / (DISPERSIONS + MEANS))
    found = log_negative_binomial(COUNTS, MEANS, DISPERSIONS)
    np.testing.assert_allclose(found, expected, rtol=1e-9)


def test_its_parts_add_up() -> None:
    whole = log_negative_binomial(COUNTS, MEANS, DISPERSIONS)
    beyond = log_beyond_none(COUNTS.astype(float), MEANS, DISPERSIONS)
    np.testing.assert_allclose(log_none(MEANS, DISPERSIONS) + beyond, whole, rtol=1e-9)
    without = log_likelihood(COUNTS, MEANS, DISPERSIONS) - whole
    factorials = [np.log(float(np.prod(np.arange(1, n + 1)))) for n in COUNTS]
    np.testing.assert_allclose(without, factorials, atol=1e-9)


def test_the_posterior_is_what_simulation_finds() -> None:
    """Of rates from Gamma(3, 2), with a quarter hidden, those that show two."""
    rng = np.random.default_rng(1)
    rates = rng.gamma(3.0, 1 / 2.0, 1_000_000)
    hidden = rng.poisson(0.25 * rates)[rng.poisson(0.75 * rates) == 2]
    mean, dispersion = hidden_posterior(3.0, 2.0, 2.0, 0.25)
    assert (mean, dispersion) == (0.25 * 5 / 2.75, 5.0)
    expected = np.exp(log_negative_binomial(np.arange(5), mean, dispersion))
    shares = np.bincount(hidden, minlength=5)[:5] / len(hidden)
    np.testing.assert_allclose(shares, expected, atol=0.004)


def test_the_posterior_is_the_same_of_arrays_and_of_tensors() -> None:
    parts = [RNG.random(6) for _ in range(4)]
    arrays = hidden_posterior(*parts)
    tensors = hidden_posterior(*map(torch.from_numpy, parts))
    for array, tensor in zip(arrays, tensors, strict=True):
        np.testing.assert_array_equal(array, tensor.numpy())


def test_a_tilted_prior_is_closed_under_thinning() -> None:
    """P(H | V) and P(V), from the joint of T and V written out."""
    a, b, f = 1.7, 0.8, 0.4
    tilts = np.array([0.3, 1.1, -0.6])
    counts = np.arange(200)
    prior = np.exp(log_negative_binomial(counts, a / b, a))
    prior[:3] *= np.exp(tilts)
    np.testing.assert_allclose(log_normaliser(tilts, a / b, a), np.log(prior.sum()))
    prior /= prior.sum()
    for seen in range(5):
        joint = prior * stats.binom.pmf(seen, counts, 1 - f)
        mean, r = hidden_posterior(a, b, seen, f)
        hidden = np.exp(log_negative_binomial(counts, mean, r))
        left = np.array(hidden_tilts(tilts, np.array(seen)))
        hidden[:3] *= np.exp(left)
        np.testing.assert_allclose((hidden / hidden.sum())[:50], joint[seen:][:50] / joint.sum())
        untilted = log_negative_binomial(seen, (1 - f) * a / b, a)
        gained = log_normaliser(left, mean, r) - log_normaliser(tilts, a / b, a)
        assert float(untilted + gained) == pytest.approx(float(np.log(joint.sum())))
    assert hidden_tilts(tilts, np.array(1)) == [1.1, -0.6, 0.0]


def test_first_counts_are_those_of_the_distribution() -> None:
    expected = np.exp(log_negative_binomial(np.arange(4), 2.5, 0.7))
    np.testing.assert_allclose(first_counts(4, expected[0], 2.5, 0.7), expected)
    assert first_counts(0, expected[0], 2.5, 0.7) == []
