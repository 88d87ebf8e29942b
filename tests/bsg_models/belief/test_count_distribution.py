"""The law of counts beside SciPy's, simulation, and the joint distribution written out."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy import stats
from scipy.special import logit
from scipy.stats import binom

from bsg_models.belief.count_distribution import (
    CountDistribution,
    blend,
    concatenate,
    negative_binomial,
    poisson,
    zero_inflated,
)
from bsg_models.belief.negative_binomial import (
    POISSON,
    log_negative_binomial,
)

MEANS = np.array([[0.5, 3.0, 0.0]])
SPREAD = np.array([[0.7, 2.0, 5.0]])


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


# Also means barely above one object, where Lambert's function branches.
GIVEN = st.one_of(st.floats(1.0, 50.0), st.floats(-16.0, 0.0).map(lambda power: 1 + 10**power))


@given(presence=st.floats(1e-6, 0.9999), excess=GIVEN)
@example(presence=1e-12, excess=1 + 1e-8)
def test_a_zero_inflated_poisson_has_the_presence_and_mean_that_it_was_given(
    presence: float, excess: float
) -> None:
    """Always the presence; the mean too, unless even a plain Poisson of that presence has more."""
    distribution = zero_inflated(np.array([[presence]]), np.array([[presence * excess]]))
    assert distribution.presence[0, 0] == pytest.approx(presence, rel=1e-6)
    least = -np.log1p(-presence)
    assert distribution.mean[0, 0] == pytest.approx(max(presence * excess, least), rel=1e-4)
    assert 0 <= distribution.weights[1, 0, 0] <= 1


def tilted(seed: int = 0, *, number: int = 2) -> CountDistribution:
    rng = np.random.default_rng(seed)
    means, r = rng.gamma(1.0, 2.0, (2, 3, 4)), rng.gamma(2.0, 1.0, (2, 3, 4)) + 0.1
    weights = np.broadcast_to(np.array([0.3, 0.7])[:, None, None], (2, 3, 1))
    return CountDistribution(means, r, weights, rng.normal(0, 1.5, (number, 2, 3, 4)))


def probabilities(distribution: CountDistribution, most: int = 400) -> np.ndarray:
    shape = distribution.means.shape[1:]
    each = [
        np.exp(distribution.log_probability(np.full(shape, float(n)), floor=0.0))
        for n in range(most)
    ]
    return np.stack(each)


@pytest.mark.parametrize("number", [1, 3])
def test_moments_of_tilted_counts_are_those_of_their_probabilities(number: int) -> None:
    distribution = tilted(number=number)
    p, counts = probabilities(distribution), np.arange(400.0)[:, None, None]
    np.testing.assert_allclose(p.sum(axis=0), 1)
    np.testing.assert_allclose(distribution.mean, (counts * p).sum(axis=0))
    second = (counts**2 * p).sum(axis=0)
    np.testing.assert_allclose(distribution.variance, second - distribution.mean**2)
    np.testing.assert_allclose(distribution.presence, 1 - p[0])
    quantile = distribution.quantile(0.7)
    assert (np.cumsum(p, axis=0) < 0.7 - 1e-12).sum(axis=0).tolist() == quantile.tolist()


@pytest.mark.parametrize("mean", [650.0, 5000.0])
def test_none_of_very_many_is_as_likely_as_its_tilt_says(mean: float) -> None:
    """A building of thousands of rooms whose presence is what its rooms say."""
    plain = poisson(np.array([[mean, 1.0]]))
    tilts = np.zeros((2, 1, 1, 2))
    tilts[0, 0, 0, 0] = mean  # what e^-mean is tilted by to be 1, as likely as all else
    distribution = replace(plain, tilts=tilts)
    assert distribution.is_finite
    np.testing.assert_allclose(distribution.presence, [[0.5, -np.expm1(-1.0)]], rtol=1e-7)
    np.testing.assert_allclose(distribution.mean, [[mean / 2, 1.0]], rtol=1e-7)
    log_none = distribution.log_probability(np.zeros((1, 2)))
    np.testing.assert_allclose(log_none, [[np.log(0.5), -1.0]], rtol=1e-7)


@pytest.mark.parametrize("distribution", [tilted(), mixture()])
def test_none_gets_likelier_by_the_odds_that_are_asked_for(distribution: CountDistribution) -> None:
    shift = np.random.default_rng(3).normal(0, 1, distribution.means.shape[1:])
    shifted = distribution.with_none_likelier(shift)
    odds, before = logit(1 - shifted.presence), logit(1 - distribution.presence)
    present = distribution.presence > 0
    np.testing.assert_allclose(odds[present], (before + shift)[present], atol=1e-6)
    before, after = probabilities(distribution, 6)[1:], probabilities(shifted, 6)[1:]
    np.testing.assert_allclose(after / after.sum(axis=0), before / before.sum(axis=0), atol=1e-12)


def test_tilts_go_with_their_nodes_and_classes() -> None:
    whole = tilted()
    p = probabilities(whole, 5)
    np.testing.assert_allclose(probabilities(whole.take(np.array([2, 0])), 5), p[:, [2, 0]])
    columns = np.array([[1, 3], [0, 0], [2, 1]])
    found = probabilities(whole.take_classes(columns), 5)
    np.testing.assert_allclose(found, np.take_along_axis(p, columns[None].repeat(5, 0), axis=2))
    plain = poisson(np.ones((3, 4)))
    both = blend([whole, plain], [0.5, 0.5])
    np.testing.assert_allclose(probabilities(both, 5), (p + probabilities(plain, 5)) / 2)
    joined = concatenate([tilted(number=1), whole])
    np.testing.assert_allclose(probabilities(joined, 5)[:, 3:], p)


def test_a_presence_is_never_below_none() -> None:
    """Where nothing is hidden, Z and the tilt of none are the same number, up to rounding."""
    tilts = np.random.default_rng(0).normal(0, 1, (2, 1, 200, 45))
    nothing = replace(negative_binomial(np.zeros((200, 45)), np.ones((200, 45))), tilts=tilts)
    assert (nothing.presence >= 0).all()
    assert nothing.presence.max() < 1e-12


@pytest.mark.parametrize(
    ("part", "value"),
    [("means", np.inf), ("dispersions", 0.0), ("weights", np.nan), ("tilts", 800.0)],
)
def test_what_is_no_number_anywhere_is_found(part: str, value: float) -> None:
    sound = tilted()
    assert sound.is_finite
    changed = getattr(sound, part).copy()
    changed.flat[-1] = value
    with np.errstate(all="ignore"):
        assert not replace(sound, **{part: changed}).is_finite


MOST = 600  # true counts that are summed over


@settings(max_examples=12)
@given(
    seed=st.integers(0, 2**32 - 1),
    tilts=st.integers(0, 3),
    parts=st.integers(1, 3),
    share=st.floats(0, 0.999),
)
def test_a_share_of_what_is_there_is_seen(seed: int, tilts: int, parts: int, share: float) -> None:
    """Against the sum over all true counts, of one share and of one of each room."""
    rng = np.random.default_rng(seed)
    shape = (parts, 3, 4)
    true = CountDistribution(
        means=rng.gamma(1, 2, shape),
        dispersions=np.where(rng.random(shape) < 0.3, np.inf, 0.2 + rng.gamma(2, 1, shape)),
        weights=rng.dirichlet(np.ones(parts), size=(3, 4)).transpose(2, 0, 1),
        tilts=rng.normal(0, 1, (tilts, *shape)) if tilts else None,
    )
    seen, p, counts = rng.integers(0, 5, (3, 4)), probabilities(true, MOST), np.arange(MOST)
    shares = np.array([[share] * 3, [0.5, 0.1, 0.9]])
    found = np.exp(true.log_seen(seen, shares))
    chances = binom.pmf(seen, counts[:, None, None, None], 1 - shares[..., None])
    np.testing.assert_allclose(found, (p[:, None] * chances).sum(axis=0), atol=1e-5)


def test_at_large_dispersions_it_becomes_a_poisson_without_a_step() -> None:
    counts = np.arange(60)
    poisson = stats.poisson.logpmf(counts, 12.5)
    found = log_negative_binomial(counts, 12.5, np.float64(POISSON))
    np.testing.assert_allclose(found, poisson, rtol=1e-11)
    below, above = (log_negative_binomial(counts, 12.5, r) for r in (0.999999e6, 1.000001e6))
    np.testing.assert_allclose(below, above, rtol=0, atol=1e-7)


@pytest.mark.parametrize("tilts", [0, 3])
def test_a_look_that_misses_is_bayes_rule(tilts: int) -> None:
    """Against a sum over all counts; two looks count twice, and a sure one leaves nothing."""
    rng = np.random.default_rng(tilts)
    shape, counts = (3, 4, 2), np.arange(400)
    weights = rng.dirichlet(np.ones(3), size=shape[1:]).transpose(2, 0, 1)
    means, dispersions = rng.gamma(1, 2, shape), rng.gamma(1, 3, shape)
    each = rng.normal(0, 1, (tilts, *shape)) if tilts else None
    before = CountDistribution(means, dispersions, weights, each)
    chance = rng.random(shape[1:])
    whole = [np.full(shape[1:], float(n)) for n in counts]
    prior = np.exp([before.log_probability(n, floor=0.0) for n in whole])
    joint = prior * (1 - chance) ** counts[:, None, None]
    after, missed = before.missed(chance), joint.sum(axis=0)
    np.testing.assert_allclose(before.miss(chance), missed, rtol=1e-9)
    np.testing.assert_allclose(after.presence, 1 - joint[0] / missed, rtol=1e-9, atol=1e-12)
    mean = (joint * counts[:, None, None]).sum(axis=0) / missed
    np.testing.assert_allclose(after.mean, mean, rtol=1e-9)
    twice = before.missed(1 - (1 - chance) ** 2)
    np.testing.assert_allclose(after.missed(chance).presence, twice.presence, rtol=1e-9)
    assert (before.missed(np.ones(shape[1:])).presence == 0).all()


@pytest.mark.parametrize("distribution", [tilted(), tilted(1, number=3), mixture()])
def test_slopes_of_a_likelihood_are_its_finite_differences(distribution: CountDistribution) -> None:
    """Of every component alone, also of a Poisson, and of means below the floor."""
    rng, step = np.random.default_rng(0), 1e-5
    counts = rng.integers(0, 6, distribution.means.shape[1:]).astype(float)
    log_p, *found = distribution.log_probability_slopes(counts)
    np.testing.assert_allclose(log_p, distribution.log_probability(counts), rtol=1e-12)
    for name, slopes in zip(("means", "dispersions"), found, strict=True):
        for part in range(len(slopes)):
            up, down = (getattr(distribution, name).copy() for _ in range(2))
            up[part] *= np.exp(step)
            down[part] *= np.exp(-step)
            more, less = (
                replace(distribution, **{name: x}).log_probability(counts) for x in (up, down)
            )
            np.testing.assert_allclose(slopes[part], (more - less) / (2 * step), atol=1e-6)
