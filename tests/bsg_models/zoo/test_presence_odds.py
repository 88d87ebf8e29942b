"""Scores of presence as distributions of counts, by hand and by simulation."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from one_building import observe_building
from scipy import stats
from scipy.special import expit, logit

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_models.errors import TrainingError
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.presence_odds import PresenceOdds, average_others, fit_odds, to_shape
from bsg_models.zoo.settings import DataConfig, ModelConfig

ODDS, RATE = np.array([-1.0, 0.5]), np.array([2.0, 0.25])


class Told(PresenceOdds):
    """Scores the first room 1 for class 0 and −2 for class 1, and says nothing of any other."""

    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Know it already."""

    def score(self, seen: Observation) -> Floats:
        scores = np.full(seen.inputs.shape, np.nan)
        scores[1] = 1.0, -2.0
        return scores


def told(*, slope: float = 0.0) -> Told:
    model = Told(ModelConfig(family="told"), ModelInputs(classes=2))
    model.odds.copy_(torch.from_numpy(ODDS))
    model.rate.copy_(torch.from_numpy(RATE))
    model.slope.fill_(slope)
    return model


def test_the_shape_gives_the_odds_that_are_asked_for() -> None:
    shape = to_shape(ODDS, RATE)
    none = stats.nbinom.pmf(0, shape, RATE / (1 + RATE))
    np.testing.assert_allclose(logit(1 - none), ODDS)


def test_a_room_that_nobody_saw_has_the_prior_moved_by_its_score() -> None:
    model = told(slope=0.5)
    model.centre.copy_(torch.tensor([0.4, 0.0]))
    inputs = [[0, 0]] * 3
    found = model.predict(observe_building(inputs, hidden_share=1.0))
    np.testing.assert_allclose(found.presence[1], expit(ODDS + np.array([0.5 * 0.6, 0.5 * -2])))
    np.testing.assert_allclose(found.presence[2], expit(ODDS))
    np.testing.assert_allclose(found.hidden[0], found.hidden[1:].sum(axis=0))


@pytest.mark.parametrize(("share", "seen"), [(0.3, 2), (0.3, 0), (1.0, 0)])
def test_what_is_hidden_is_bayes_rule_over_what_is_there(share: float, seen: int) -> None:
    """P(H | V) = P(T = V + H) P(V of T are seen) / P(V), summed over all T."""
    found = told().predict(observe_building([[seen, seen]] * 2, hidden_share=share))
    total = np.arange(400)
    for c, (shape, rate) in enumerate(zip(to_shape(ODDS, RATE), RATE, strict=True)):
        there = stats.nbinom.pmf(total, shape, rate / (1 + rate))
        joint = (there * stats.binom.pmf(seen, total, 1 - np.float32(share)))[seen:]
        posterior = joint / joint.sum()
        for hidden in range(4):
            log_p = found.log_probability(np.full((2, 2), float(hidden)), floor=0.0)[1, c]
            assert np.exp(log_p) == pytest.approx(posterior[hidden])
        assert found.hidden[1, c] == pytest.approx(posterior @ np.arange(len(posterior)))


def test_nothing_is_hidden_where_all_was_seen() -> None:
    found = told(slope=2.0).predict(observe_building([[3, 0]] * 2, hidden_share=0.0))
    assert not found.hidden.any()
    assert not found.presence.any()


def test_the_mean_over_others_leaves_out_the_class_itself_and_silence() -> None:
    table = np.array([[9.0, 1.0, 2.0], [3.0, 9.0, np.nan], [5.0, np.nan, 9.0]])
    visible = np.array([[True, True, False], [False, True, False], [False, False, False]])
    found = average_others(visible, table)
    np.testing.assert_array_equal(found[0], [3.0, 1.0, 2.0])
    np.testing.assert_array_equal(found[1], [3.0, np.nan, np.nan])
    assert np.isnan(found[2]).all()


def simulate(slope: float) -> tuple[Floats, Floats, Floats, Floats]:
    """Return scores, seen, hidden and shares of 4000 rooms that keep the model."""
    rng = np.random.default_rng(0)
    scores = rng.normal(0, 2, (4000, 2))
    there = rng.poisson(rng.gamma(to_shape(ODDS + slope * scores, RATE)) / RATE)
    share = rng.uniform(0.1, 0.9, 4000)
    hidden = rng.binomial(there, share[:, None])
    return scores, (there - hidden).astype(float), hidden.astype(float), share


def test_the_fit_finds_what_rooms_were_made_with() -> None:
    scores, seen, hidden, share = simulate(0.4)
    odds, rate, slope = fit_odds(scores, seen, hidden, share, prior=np.ones((2, 2)))
    assert slope == pytest.approx(0.4, abs=0.03)
    np.testing.assert_allclose(odds, ODDS, atol=0.15)
    np.testing.assert_allclose(rate, RATE, rtol=0.15)


def test_a_score_that_misleads_is_left_out() -> None:
    scores, seen, hidden, share = simulate(0.4)
    assert fit_odds(-scores, seen, hidden, share, prior=np.ones((2, 2)))[2] == 0.0


def test_a_class_that_never_occurs_stays_near_its_prior() -> None:
    scores, seen, hidden, share = (part[:50] for part in simulate(0.0))
    seen[:, 0] = hidden[:, 0] = 0
    prior = np.array([[0.01, 1.0], [1.0, 1.0]])
    odds, rate, _ = fit_odds(scores, seen, hidden, share, prior=prior)
    assert -7 < odds[0] < -4
    assert rate[0] == pytest.approx(1.0, rel=0.1)


@pytest.mark.parametrize("fractions", [None, (0.0, 0.0)])
def test_masks_that_hide_nothing_are_refused(
    dataset: Path, fractions: tuple[float, float] | None
) -> None:
    model = Told(ModelConfig(family="told"), ModelInputs(classes=45))
    choice = DataConfig(mask=MaskRecipe(fraction=0.0), fractions=fractions)
    with pytest.raises(TrainingError):
        model.fit(Dataset.open(dataset), choice)
