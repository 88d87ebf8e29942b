"""The fit of room types: planted types, a naive sum over types, chunks and samples of rooms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

from bsg_data.arrays import Ints
from bsg_models.zoo import room_types
from bsg_models.zoo.room_types import FittedTypes, fit_types


def rooms_of_two_types(number: int) -> tuple[Ints, Ints]:
    """Return counts `[number, 3]` of rooms of two types, and the type of each."""
    rng = np.random.default_rng(0)
    means = np.array([[6.0, 0.1, 1.0], [0.1, 4.0, 1.0]])
    kind = rng.choice(2, number, p=[0.6, 0.4])
    return rng.poisson(rng.gamma(2.0, means[kind] / 2.0)), kind


def tensors(fitted: FittedTypes) -> list[np.ndarray]:
    return [fitted.log_types, fitted.means, fitted.dispersions, fitted.tilts]


def test_tilts_give_the_first_counts_their_shares() -> None:
    """Rooms of one toilet each: a negative binomial alone says two in many."""
    counts = np.ones((400, 1), dtype=np.int64)
    fitted = fit_types(counts, types=1, iterations=20, seed=0, tilted=2)
    p = stats.nbinom.pmf([0, 1, 2], r := fitted.dispersions[0, 0], r / (r + fitted.means[0, 0]))
    p[:2] *= np.exp(fitted.tilts[:, 0, 0])
    assert p[1] / p.sum() > 0.9
    assert fitted.expected[0, 0] == pytest.approx(1.0, abs=0.1)


def test_planted_types_are_found() -> None:
    rng = np.random.default_rng(0)
    means = np.array([[6.0, 0.1, 1.0], [0.1, 4.0, 1.0]])
    kind = rng.choice(2, 3000, p=[0.6, 0.4])
    counts = rng.poisson(rng.gamma(2.0, means[kind] / 2.0))
    fitted = fit_types(counts, types=2, iterations=60, seed=0)
    log_types, found, shapes = fitted.log_types, fitted.means, fitted.dispersions
    order = np.argsort(-found[:, 0])
    np.testing.assert_allclose(found[order], means, rtol=0.15, atol=0.05)
    np.testing.assert_allclose(np.exp(log_types[order]), [0.6, 0.4], atol=0.03)
    assert (fitted.belonging(counts).argmax(axis=1) == order[kind]).mean() > 0.93  # types overlap
    np.testing.assert_allclose(shapes[order[0], 0], 2.0, rtol=0.25)


def test_more_iterations_never_lose_likelihood() -> None:
    rng = np.random.default_rng(1)
    counts = rng.poisson(rng.gamma(0.7, 2.0, (300, 6)))

    def likelihood(iterations: int) -> float:
        fitted = fit_types(counts, types=4, iterations=iterations, seed=0)
        log_types, means, r = fitted.log_types, fitted.means, fitted.dispersions
        distribution = stats.nbinom.logpmf(counts[:, None], r, r / (r + means)).sum(axis=2)
        prior = stats.norm.logpdf(np.log(r)).sum()  # what the fit maximises has it
        return float(np.logaddexp.reduce(log_types + distribution, axis=1).sum() + prior)

    values = [likelihood(iterations) for iterations in (2, 10, 40)]
    assert values == sorted(values)


def test_types_of_rooms_are_those_of_a_naive_sum() -> None:
    fitted = FittedTypes(
        log_types=np.log([0.7, 0.3]),
        means=np.array([[4.0, 0.1], [0.2, 3.0]]),
        dispersions=np.array([[2.0, 1.0], [1.0, 5.0]]),
        tilts=np.array([[[0.5, 1.0], [-1.0, 0.2]], [[1.5, 0.0], [0.3, -0.7]]]),
    )
    counts = np.array([[0, 0], [7, 1], [1, 12], [2, 0]])
    values = np.arange(150)
    joint = np.log([[0.7, 0.3]]) * np.ones((4, 1))
    for k in range(2):
        for c in range(2):
            m, r = fitted.means[k, c], fitted.dispersions[k, c]
            p = stats.nbinom.pmf(values, r, r / (r + m))
            p[:2] *= np.exp(fitted.tilts[:, k, c])
            joint[:, k] += np.log(p / p.sum())[counts[:, c]]
    log_room = np.logaddexp(*joint.T)
    np.testing.assert_allclose(fitted.log_probability(counts), log_room)
    np.testing.assert_allclose(fitted.belonging(counts), np.exp(joint - log_room[:, None]))


def test_neither_chunks_nor_bytes_change_the_fit(monkeypatch: pytest.MonkeyPatch) -> None:
    counts, _ = rooms_of_two_types(300)
    whole = fit_types(counts, types=3, iterations=20, seed=0, tilted=2)
    monkeypatch.setattr(room_types, "_CHUNK", 7)
    parts = fit_types(counts.astype(np.uint8), types=3, iterations=20, seed=0, tilted=2)
    for one, other in zip(tensors(whole), tensors(parts), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-7, atol=1e-9)


def test_a_start_from_a_sample_is_as_good() -> None:
    """All rounds on a tenth of the rooms, then ten on all of them."""
    counts, _ = rooms_of_two_types(4000)
    full = fit_types(counts, types=2, iterations=60, seed=0, tilted=2)
    quick, again = (
        fit_types(counts, types=2, iterations=60, seed=0, tilted=2, sample=400) for _ in range(2)
    )
    lost = full.log_probability(counts).mean() - quick.log_probability(counts).mean()
    assert lost < 1e-3  # of 5 nats a room
    for one, other in zip(tensors(quick), tensors(again), strict=True):
        np.testing.assert_array_equal(one, other)
