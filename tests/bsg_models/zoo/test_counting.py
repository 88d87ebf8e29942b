"""Models that count, by hand; the contract of all models is proved in `test_testing.py`."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import make_zoo_model, observe_building
from scipy import stats

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import sample_masked
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.count_distribution import CountDistribution, negative_binomial
from bsg_models.inputs.folds import scenes_of
from bsg_models.training.training import new_model
from bsg_models.zoo.calibration import fit_calibration
from bsg_models.zoo.config import find_config
from bsg_models.zoo.gamma_poisson import (
    fit_gamma_prior,
)
from bsg_models.zoo.model import BeliefModel
from bsg_models.zoo.room_sums import sum_rooms

STOVE = 35


def fitted(name: str, dataset: Path) -> BeliefModel:
    torch.manual_seed(0)
    data = Dataset.open(dataset)
    config = find_config(name)
    model = new_model(config, data)
    model.fit(data, config.data)
    return model


def test_input_and_doubled_by_hand(dataset: Path) -> None:
    inputs = [[4.0, 1.0], [3.0, 1.0]]
    assert (fitted("input", dataset).predict(observe_building(inputs)).hidden == 0).all()
    doubled = fitted("doubled", dataset)
    assert doubled.predict(observe_building(inputs)).expected.tolist() == [[8.0, 2.0], [6.0, 2.0]]
    more = doubled.predict(observe_building(inputs, hidden_share=0.75))
    assert more.expected.tolist()[1] == [12.0, 4.0]
    assert doubled.predict(observe_building(inputs, hidden_share=0.0)).expected.tolist() == inputs
    assert np.isfinite(
        doubled.predict(observe_building([[0.0, 0.0]], hidden_share=1.0)).hidden
    ).all()


def test_train_mean_is_the_mean_of_the_training_rooms_and_buildings(dataset: Path) -> None:
    data = Dataset.open(dataset)
    scenes = scenes_of(data, "train")
    found = fitted("train-mean", dataset).predict(observe_building([[0.0] * 45] * 3))
    rooms = np.concatenate([data.cells(scene)[1:] for scene in scenes])
    buildings = np.stack([data.cells(scene).sum(axis=0) for scene in scenes])
    np.testing.assert_allclose(found.totals[1], rooms.mean(axis=0))
    np.testing.assert_allclose(found.totals[0], buildings.mean(axis=0))
    np.testing.assert_allclose(found.hidden, found.totals / 2)


def test_the_gamma_prior_maximises_scipys_likelihood() -> None:
    counts = stats.nbinom(1.5, 1.5 / (1.5 + 2.0)).rvs(4000, random_state=0)
    a, b = fit_gamma_prior(np.unique(counts, return_counts=True))
    assert a / b == pytest.approx(counts.mean())

    def likelihood(shape: float) -> float:
        mean = counts.mean()
        return float(stats.nbinom.logpmf(counts, shape, shape / (shape + mean)).sum())

    assert likelihood(a) >= max(likelihood(0.97 * a), likelihood(1.03 * a))
    assert a == pytest.approx(1.5, rel=0.15)


def test_gamma_poisson_by_hand() -> None:
    """Prior Gamma(2, 1), 3 seen of a mask of one half: posterior Gamma(5, 1.5), hidden mean 5/3."""
    model = make_zoo_model("gamma-poisson", classes=1)
    model.hold(shape=np.full_like(model.shape, 2.0), rate=np.ones_like(model.rate))
    found = model.predict(observe_building([[3.0], [3.0], [0.0]]))
    assert found.hidden[1, 0] == pytest.approx(0.5 * 5 / 1.5)
    assert found.hidden_counts.dispersions[0, 1, 0] == 5
    assert found.hidden[0, 0] == pytest.approx(found.hidden[1:].sum())


def test_a_building_of_tilted_rooms_has_what_any_of_them_has() -> None:
    """Its mean is the sum of the rooms', its P(0) their product, Poissons and mixtures too."""
    rng = np.random.default_rng(0)
    seen = observe_building([[0] * 6] * 5)
    means, r = rng.gamma(1.0, 1.0, (2, 5, 6)), rng.gamma(2.0, 1.0, (2, 5, 6)) + 0.05
    r[1, 2:] = np.inf
    means[:, :, 5] = 1e-14  # what no room has
    tilts = rng.normal(0, 1.5, (2, 2, 5, 6))
    tilts[:, :, :, 0] = [[[-4.0]], [[4.0]]]  # exactly one in every room
    distribution = CountDistribution(means, r, np.full((2, 5, 1), 0.5), tilts)
    found = sum_rooms(distribution, seen)
    np.testing.assert_allclose(found.mean[0], distribution.mean[1:].sum(axis=0), rtol=1e-6)
    none = (1 - distribution.presence[1:]).prod(axis=0)
    np.testing.assert_allclose(found.presence[0], 1 - none, atol=1e-9)
    np.testing.assert_array_equal(found.presence[1:], distribution.presence[1:])


def test_calibration_mends_what_is_too_sure() -> None:
    rng = np.random.default_rng(0)
    rates = rng.gamma(1.0, 2.0, (4000, 3))
    hidden = rng.poisson(rng.gamma(2.0, rates / 2.0)).astype(float)
    distorted = negative_binomial(0.6 * rates**1.4, np.full(rates.shape, 5.0))
    found = fit_calibration(distorted, hidden)
    mended = distorted.recalibrated(found)
    assert mended.log_probability(hidden).mean() > distorted.log_probability(hidden).mean()
    np.testing.assert_allclose(np.exp(found[1]), 1 / 1.4, rtol=0.05)
    np.testing.assert_allclose(mended.dispersions[0, 0, 0], 2.0, rtol=0.15)
    perfect = negative_binomial(rates, np.full(rates.shape, 2.0))
    np.testing.assert_allclose(fit_calibration(perfect, hidden), 0, atol=0.05)
    best = distorted.recalibrated(found).log_probability(hidden).mean()
    for near in found + 0.01 * np.concatenate([np.eye(3), -np.eye(3)]):
        assert distorted.recalibrated(near).log_probability(hidden).mean() < best


@pytest.mark.parametrize("name", ["gamma-poisson", "mixture", "universal"])
def test_a_withheld_class_is_expected_more_than_one_that_was_not_seen(
    name: str, dataset: Path
) -> None:
    model = fitted(name, dataset)
    data = Dataset.open(dataset)
    scenes = scenes_of(data, "val")[:1]
    masked = sample_masked(data, scenes, mask=MaskRecipe(), draw=0, vocabulary=model.vocabulary)
    inputs, withheld = masked.seen.inputs.copy(), masked.seen.withheld.copy()
    inputs[:, STOVE] = 0
    withheld[:, STOVE] = True
    seen = replace(masked.seen, inputs=inputs, unclassified=np.zeros_like(masked.seen.unclassified))
    rooms = ~seen.is_building
    absent = model.predict(seen).hidden[rooms, STOVE]
    told = model.predict(replace(seen, withheld=withheld)).hidden[rooms, STOVE]
    assert (told > absent).all()
