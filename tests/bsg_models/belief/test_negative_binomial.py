"""The law of counts beside SciPy's, simulation, and the joint distribution written out."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from scipy import stats

from bsg_models.belief.negative_binomial import (
    POISSON,
    hidden_posterior,
    hidden_tilts,
    log_negative_binomial,
    log_normaliser,
)

RNG = np.random.default_rng(0)
COUNTS = RNG.poisson(2.0, 50)
MEANS, DISPERSIONS = RNG.gamma(2.0, 1.0, 50), RNG.gamma(2.0, 2.0, 50)


def test_at_large_dispersions_it_becomes_a_poisson_without_a_step() -> None:
    counts = np.arange(60)
    poisson = stats.poisson.logpmf(counts, 12.5)
    found = log_negative_binomial(counts, 12.5, np.float64(POISSON))
    np.testing.assert_allclose(found, poisson, rtol=1e-11)
    below, above = (log_negative_binomial(counts, 12.5, r) for r in (0.999999e6, 1.000001e6))
    np.testing.assert_allclose(below, above, rtol=0, atol=1e-7)


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


@pytest.mark.parametrize("number", [0, 1, 3])
def test_arrays_and_tensors_have_one_law(number: int) -> None:
    seen, share = RNG.poisson(1.0, 50).astype(float), RNG.random(50)
    tilts = list(RNG.normal(0, 1, (number, 50)))
    parts = (MEANS, DISPERSIONS / MEANS, seen, share)
    arrays = hidden_posterior(*parts)
    found = log_negative_binomial(COUNTS, *arrays, hidden_tilts(tilts, seen))
    torches = [torch.from_numpy(part) for part in parts]
    tensors = hidden_posterior(*torches)
    left = hidden_tilts([torch.from_numpy(tilt) for tilt in tilts], torches[2])
    same = log_negative_binomial(torch.from_numpy(COUNTS.astype(float)), *tensors, left)
    np.testing.assert_allclose(same.numpy(), found, rtol=1e-12)


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
        left = np.array(hidden_tilts(tilts, np.array(seen)))
        hidden = np.exp(log_negative_binomial(counts, mean, r, left))
        np.testing.assert_allclose(hidden[:50], joint[seen:][:50] / joint.sum())
        untilted = log_negative_binomial(seen, (1 - f) * a / b, a)
        gained = log_normaliser(left, mean, r) - log_normaliser(tilts, a / b, a)
        assert float(untilted + gained) == pytest.approx(float(np.log(joint.sum())))
    assert hidden_tilts(tilts, np.array(1)) == [1.1, -0.6, 0.0]
