"""Room types: the posterior by a naive loop, the building's habits."""

from __future__ import annotations

import numpy as np
import pytest
import torch
from one_building import observe_building
from scipy import stats

from bsg_models.zoo.mixture import MixtureConfig, RoomTypeMixture, fit_habit
from bsg_models.zoo.model import ModelInputs


def two_types(*, temper: float = 1.0, building: bool = False, tilted: int = 0) -> RoomTypeMixture:
    config = MixtureConfig(types=2, temper=temper, building=building, tilted=tilted)
    model = RoomTypeMixture(config, ModelInputs(classes=2))
    model.log_types.copy_(torch.log(torch.tensor([0.7, 0.3])))
    model.means.copy_(torch.tensor([[4.0, 0.1], [0.2, 3.0]]))
    model.dispersions.copy_(torch.tensor([[2.0, 1.0], [1.0, 5.0]]))
    model.habits.fill_(2.0)
    return model


def naive_posterior(model: RoomTypeMixture, seen: list[float], f: float) -> np.ndarray:
    weights = []
    for k in range(2):
        weight = float(model.log_types[k].exp())
        for c in range(2):
            m, r = (1 - f) * float(model.means[k, c]), float(model.dispersions[k, c])
            weight *= stats.nbinom.pmf(seen[c], r, r / (r + m)) ** model.config.temper
        weights.append(weight)
    return np.array(weights) / sum(weights)


@pytest.mark.parametrize("temper", [1.0, 0.5])
def test_the_posterior_is_that_of_a_naive_loop(temper: float) -> None:
    model = two_types(temper=temper)
    seen, f = [2.0, 1.0], 0.375
    found = model.predict(observe_building([seen, seen], hidden_share=f))
    posterior = naive_posterior(model, seen, f)
    np.testing.assert_allclose(found.hidden_counts.weights[:, 1, 0], posterior)
    mean = np.zeros(2)
    for k in range(2):
        for c in range(2):
            r, m = float(model.dispersions[k, c]), float(model.means[k, c])
            mean[c] += posterior[k] * f * (r + seen[c]) / (r / m + 1 - f)
    np.testing.assert_allclose(found.hidden[1], mean)


def test_the_posterior_predicts_what_its_own_rooms_hide() -> None:
    """Among rooms drawn from the model with (1, 0) seen, the hidden ones follow its posterior."""
    rng = np.random.default_rng(0)
    model, rooms = two_types(), 400_000
    kind = rng.choice(2, rooms, p=[0.7, 0.3])
    means, shapes = model.means.numpy()[kind], model.dispersions.numpy()[kind]
    there = rng.poisson(rng.gamma(shapes, means / shapes))
    seen = rng.binomial(there, 0.5)
    chosen = (seen == [1, 0]).all(axis=1)
    hidden = (there - seen)[chosen]
    found = model.predict(observe_building([[1, 0], [1, 0]]))
    for c in range(2):
        distribution = [
            np.exp(found.log_probability(np.full((2, 2), float(n))))[1, c] for n in range(5)
        ]
        share = np.bincount(hidden[:, c], minlength=5)[:5] / len(hidden)
        np.testing.assert_allclose(share, distribution, atol=0.01)


def test_the_posterior_of_tilted_types_is_that_of_the_joint_written_out() -> None:
    """P(type, hidden | seen), from P(type) Π P(T | type) P(V | T) over all T."""
    model, f, seen = two_types(tilted=2), 0.375, [2, 0]
    model.tilts.copy_(torch.tensor([[[0.5, 1.0], [-1.0, 0.2]], [[1.5, 0.0], [0.3, -0.7]]]))
    counts, joint = np.arange(300), np.zeros((2, 2, 300))
    for k in range(2):
        for c in range(2):
            m, r = float(model.means[k, c]), float(model.dispersions[k, c])
            prior = stats.nbinom.pmf(counts, r, r / (r + m))
            prior[:2] *= np.exp(model.tilts[:, k, c].numpy())
            joint[k, c] = prior / prior.sum() * stats.binom.pmf(seen[c], counts, 1 - f)
    evidence = joint.sum(axis=2)
    weights = np.exp(model.log_types.numpy()) * evidence.prod(axis=1)
    weights /= weights.sum()
    found = model.predict(observe_building([seen, seen], hidden_share=f)).hidden_counts
    np.testing.assert_allclose(found.weights[:, 1, 0], weights)
    for c in range(2):
        of_type = joint[:, c, seen[c] :] / evidence[:, c, None]
        expected = (weights[:, None] * of_type).sum(axis=0)
        p = [
            np.exp(found.log_probability(np.full((2, 2), float(n)), floor=0))[1, c]
            for n in range(6)
        ]
        np.testing.assert_allclose(p, expected[:6])


def test_an_unvisited_room_is_what_the_others_are() -> None:
    """Three rooms of the second type make it likelier, and their habit raises its count."""
    model = two_types(building=True)
    seen = observe_building(
        [[0, 12], *[[0, 4]] * 3, [0, 0]],
        hidden_share=[0.5, 0.5, 0.5, 0.5, 1.0],
        visited=[True, True, True, True, False],
    )
    found = model.predict(seen)
    alone = observe_building([[0, 0], [0, 0]], hidden_share=1.0, visited=[True, False])
    before = model.predict(alone)
    np.testing.assert_allclose(before.hidden_counts.weights[:, 1, 0], [0.7, 0.3])
    assert found.hidden_counts.weights[1, 4, 0] > 0.45
    assert found.hidden[4, 1] > before.hidden[1, 1]
    assert found.hidden[4, 0] < before.hidden[1, 0]


def test_buildings_that_differ_have_habits_and_those_that_do_not_have_none() -> None:
    rng = np.random.default_rng(0)
    expected = rng.uniform(5, 20, 400)
    alike = rng.poisson(expected).astype(float)
    differing = rng.poisson(rng.gamma(1.5, expected / 1.5)).astype(float)
    assert fit_habit(alike, expected) > 100
    assert fit_habit(differing, expected) == pytest.approx(1.5, rel=0.2)


def test_what_is_glimpsed_is_evidence() -> None:
    """A room that was not entered and hides 3/8 says what one says that was."""
    model = two_types(building=True)
    rooms = [[5.0, 3.0], [2.0, 1.0], [3.0, 2.0]]
    entered = model.predict(observe_building(rooms, hidden_share=0.375))
    glimpsed = model.predict(
        observe_building(rooms, hidden_share=0.375, visited=[True, False, True])
    )
    np.testing.assert_array_equal(glimpsed.hidden, entered.hidden)


def test_a_searched_room_hides_nothing_for_sure() -> None:
    """Its tilts are left out, so that the least rate of a likelihood is not multiplied by them."""
    model = two_types(tilted=2)
    model.tilts.copy_(torch.tensor([[[-3.0, -3.0]] * 2, [[3.0, 3.0]] * 2]))
    found = model.predict(observe_building([[3, 1], [2, 1], [1, 0]], hidden_share=[0.25, 0.0, 0.5]))
    assert not found.presence[1].any()
    np.testing.assert_allclose(found.log_probability(np.zeros((3, 2)))[1], 0, atol=0.002)
