"""Room types: their fit, the posterior by a naive loop, the building's habits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from one_building import make_zoo_model, observe_building, surround_rooms
from scipy import stats

from bsg_data.scene.class_space import load_class_space
from bsg_data.scene.room_label import list_room_labels
from bsg_models.zoo.hand_prior import HandPrior, read_hand_prior
from bsg_models.zoo.mixture import choose_labels, fit_habit, fit_labels
from bsg_models.zoo.room_types import FittedTypes, fit_named_types, fit_types


def two_types(*, temper: float = 1.0, building: bool = False, tilted: int = 0) -> Any:
    how: dict[str, Any] = {"temper": temper, "building": building, "tilted": tilted}
    model = make_zoo_model("mixture", classes=2, types=2, **how)
    model.hold(
        log_types=np.log([0.7, 0.3]),
        means=[[4.0, 0.1], [0.2, 3.0]],
        dispersions=[[2.0, 1.0], [1.0, 5.0]],
        habits=[2.0, 2.0],
    )
    return model


def naive_posterior(model: Any, seen: list[float], f: float) -> np.ndarray:
    weights = []
    for k in range(2):
        weight = float(np.exp(model.log_types[k]))
        for c in range(2):
            m, r = (1 - f) * float(model.means[k, c]), float(model.dispersions[k, c])
            weight *= stats.nbinom.pmf(seen[c], r, r / (r + m)) ** model.config.temper
        weights.append(weight)
    return np.array(weights) / sum(weights)


def test_the_posterior_is_that_of_a_naive_loop() -> None:
    model = two_types(temper=0.5)
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


@pytest.mark.parametrize("visited", [True, False])
def test_a_label_multiplies_the_odds_of_the_types(visited: bool) -> None:
    model, seen, f = two_types(), [2.0, 1.0], 0.375
    kitchen = list_room_labels().index("kitchen")
    odds = np.zeros_like(model.labels)
    odds[:, kitchen] = np.log([0.25, 3.0])
    model.hold(labels=odds)
    around = surround_rooms([None] * 2, ["kitchen", None])
    found = model.predict(
        observe_building(
            [[0, 0], seen, [0, 0]],
            hidden_share=[1.0, f if visited else 1.0, 1.0],
            visited=[True, visited, False],
            surroundings=around,
        )
    ).hidden_counts
    told = naive_posterior(model, seen, f) if visited else np.array([0.7, 0.3])
    told = told * [0.25, 3.0]
    np.testing.assert_allclose(found.weights[:, 1, 0], told / told.sum(), rtol=1e-6)
    np.testing.assert_allclose(found.weights[:, 2, 0], [0.7, 0.3])  # nobody said what it is


def test_labels_say_what_the_labelled_rooms_are() -> None:
    """Three kitchens of the first type, one bath of the second; rooms without a label say nothing.

    A label that no room has says nothing of the type.
    """
    belonging = np.array([[1, 0], [1, 0], [1, 0], [0, 1], [0, 1], [0, 1]], dtype=float)
    labels = np.array([[1, 0, 0], [1, 0, 0], [1, 0, 0], [0, 1, 0], [0, 0, 0], [0, 0, 0]])
    types = np.array([4, 2]) / 6  # of labelled rooms, one more of each
    kitchen = (np.array([3, 0]) + 4 * types) / 7
    bath = (np.array([0, 1]) + 4 * types) / 5
    found = fit_labels(belonging, labels)
    np.testing.assert_allclose(np.exp(found) * types[:, None], np.array([kitchen, bath, types]).T)


def test_the_posterior_of_tilted_types_is_that_of_the_joint_written_out() -> None:
    """P(type, hidden | seen), from P(type) Π P(T | type) P(V | T) over all T."""
    model, f, seen = two_types(tilted=2), 0.375, [2, 0]
    model.hold(tilts=[[[0.5, 1.0], [-1.0, 0.2]], [[1.5, 0.0], [0.3, -0.7]]])
    counts, joint = np.arange(300), np.zeros((2, 2, 300))
    for k in range(2):
        for c in range(2):
            m, r = float(model.means[k, c]), float(model.dispersions[k, c])
            prior = stats.nbinom.pmf(counts, r, r / (r + m))
            prior[:2] *= np.exp(model.tilts[:, k, c])
            joint[k, c] = prior / prior.sum() * stats.binom.pmf(seen[c], counts, 1 - f)
    evidence = joint.sum(axis=2)
    weights = np.exp(model.log_types) * evidence.prod(axis=1)
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


def test_a_searched_room_hides_nothing_for_sure() -> None:
    """Its tilts are left out, so that the least rate of a likelihood is not multiplied by them."""
    model = two_types(tilted=2)
    model.hold(tilts=[[[-3.0, -3.0]] * 2, [[3.0, 3.0]] * 2])
    found = model.predict(observe_building([[3, 1], [2, 1], [1, 0]], hidden_share=[0.25, 0.0, 0.5]))
    assert not found.presence[1].any()
    np.testing.assert_allclose(found.log_probability(np.zeros((3, 2)))[1], 0, atol=0.002)


def test_tilts_give_the_first_counts_their_shares() -> None:
    """Rooms of one toilet each: a negative binomial alone says two in many."""
    counts = np.ones((400, 1), dtype=np.int64)
    fitted = fit_types(counts, types=1, iterations=20, seed=0, tilted=2)
    p = stats.nbinom.pmf([0, 1, 2], r := fitted.dispersions[0, 0], r / (r + fitted.means[0, 0]))
    p[:2] *= np.exp(fitted.tilts[:, 0, 0])
    assert p[1] / p.sum() > 0.9
    assert fitted.expected[0, 0] == pytest.approx(1.0, abs=0.1)


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
    types, found = fitted.weigh(counts)
    np.testing.assert_allclose(found, log_room)
    np.testing.assert_allclose(types, np.exp(joint - log_room[:, None]))


def test_planted_types_are_found() -> None:
    rng = np.random.default_rng(0)
    means = np.array([[6.0, 0.1, 1.0], [0.1, 4.0, 1.0]])
    kind = rng.choice(2, 1500, p=[0.6, 0.4])
    counts = rng.poisson(rng.gamma(2.0, means[kind] / 2.0))
    fitted = fit_types(counts, types=2, iterations=30, seed=0)
    order = np.argsort(-fitted.means[:, 0])
    np.testing.assert_allclose(fitted.means[order], means, rtol=0.15, atol=0.05)
    np.testing.assert_allclose(np.exp(fitted.log_types[order]), [0.6, 0.4], atol=0.03)
    assert (fitted.weigh(counts)[0].argmax(axis=1) == order[kind]).mean() > 0.93  # types overlap
    np.testing.assert_allclose(fitted.dispersions[order[0], 0], 2.0, rtol=0.25)


def presence_of(fitted: FittedTypes) -> np.ndarray:
    return np.asarray(1 - np.exp(fitted.tabulate(2)[..., 0]))


def test_named_types_without_rooms_are_what_the_table_says() -> None:
    table = read_hand_prior(load_class_space().classes)
    labels, classes = table.presence.shape
    nothing = np.zeros((1, classes), dtype=np.int64)
    fitted = fit_named_types(nothing, np.zeros((1, labels)), table, tilted=2)
    np.testing.assert_allclose(presence_of(fitted), table.presence, atol=0.01)
    np.testing.assert_allclose(np.exp(fitted.log_types), table.usual)
    assert fitted.expected[list_room_labels().index("kitchen")].max() < 1.5, "one stove, not ten"


def test_named_types_weigh_rooms_against_fifty_of_the_table() -> None:
    """All of fifty kitchens have a stove, and none a bed; the other kind stays as it was."""
    table = HandPrior(usual=np.array([0.5, 0.5]), presence=np.array([[0.6, 0.1], [0.02, 0.8]]))
    counts, labels = np.array([[1, 0]] * 50), np.array([[1.0, 0.0]] * 50)
    found = presence_of(fit_named_types(counts, labels, table, tilted=2))
    np.testing.assert_allclose(found, [[0.8, 0.05], [0.02, 0.8]], atol=0.01)


def test_a_kind_that_homes_have_is_learned_in_homes() -> None:
    """Corridors of a home and a school, and a classroom; a room of nobody's kind teaches none."""
    labels = np.array([[1.0, 0.0], [1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    chosen = choose_labels(labels, np.array([True, False, False, True]))
    np.testing.assert_array_equal(chosen, [[1, 0], [0, 0], [0, 1], [0, 0]])
