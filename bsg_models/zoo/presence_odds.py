"""Scores of presence as distributions of counts: what rivals say, made comparable.

A rival gives a score s to a class in a room: a cosine, a logarithm of how often two classes meet,
what somebody wrote down. It moves the odds that the room has the class at all:

    logit P(T > 0) = o_c + β (s − s̄_c)             s̄ the mean score, o_c and β fitted
    T ~ NB(dispersion k, rate b_c)                  k = −log P(T = 0) / log(1 + 1 / b_c)
    H | V ~ NB(mean f (k + V) / (b_c + 1 − f), dispersion k + V)

T is what is there, V what was seen of it, H what is hidden. NB(k, b) is a Poisson number of
clusters whose sizes do not depend on k, so a likelier class comes in more clusters of the usual
size; and it is Poisson counts with the prior Gamma(k, b), so the last line, Bayes' rule, holds at
every share f: at 0 nothing is hidden, at 1 it is the prior, and all between are the same room. The
score of a class is of the *other* classes: what was seen of itself is in V, and would count twice.
Where a score says nothing, in a room that nobody looked into, it moves nothing.

o, b and the one slope β are those under which the hidden counts of masked training rooms are most
likely. A slope is never below 0: a score that misleads is left out, not turned round. Of many rooms
a sample is read (`bsg_models.zoo.masked_rooms.MOST_ROOMS`): the fit holds all of them at once.
"""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
import torch
from scipy.optimize import minimize
from scipy.special import logit

from bsg_data.arrays import Bools, Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.count_distribution import negative_binomial
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.belief.negative_binomial import hidden_posterior
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.complete_rooms import tally_rooms
from bsg_models.zoo.gamma_poisson import fit_gamma_prior
from bsg_models.zoo.masked_rooms import choose_buildings, describe_sample, sample_chosen
from bsg_models.zoo.model import BeliefModel, ModelInputs, to_array
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import DataConfig, ModelConfig

_DRAWS = 3  # masks of every training building
_MOST_ODDS = 12.0  # of a presence, as a logarithm: beyond it is no difference
_RIDGE = 1.0  # holds what few rooms tell of near the prior


class PresenceOdds(BeliefModel):
    """A score of presence, made a distribution of the hidden counts.

    Attributes:
        odds: `[C]` o, log odds that a room has the class.
        rate: `[C]` b of the Gamma prior.
        centre: `[C]` s̄, the mean score in training rooms.
        slope: β.
    """

    odds: torch.Tensor
    rate: torch.Tensor
    centre: torch.Tensor
    slope: torch.Tensor

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        classes = inputs.classes
        self.register_buffer("odds", torch.zeros(classes, dtype=torch.float64))
        self.register_buffer("rate", torch.ones(classes, dtype=torch.float64))
        self.register_buffer("centre", torch.zeros(classes, dtype=torch.float64))
        self.register_buffer("slope", torch.zeros((), dtype=torch.float64))

    @abstractmethod
    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Read into buffers what scores come from, for these classes `[C]`."""

    @abstractmethod
    def score(self, seen: Observation) -> Floats:
        """Return the scores `[N, C]`, of each class from the others; NaN where nothing is said."""

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Fit odds, rates and the slope on masks of the training rooms."""
        self.read_knowledge(data.manifest.class_space.classes)
        uniform, every = _uniform(choice), scenes_of(data, "train", fold=choice.fold)
        scenes = choose_buildings(data, uniform)
        if len(scenes) < len(every):
            self.notes = (describe_sample(len(scenes), len(every)),)
        masked = sample_chosen(data, uniform, scenes, draws=_DRAWS)
        share = masked.seen.hidden_share.astype(np.float64)
        rooms = ~masked.seen.is_building & (share > 0)
        scores = self.score(masked.seen)[rooms]
        told = ~np.isnan(scores)
        total = np.where(told, scores, 0.0).sum(axis=0)
        self.centre.copy_(torch.from_numpy(total / np.maximum(told.sum(axis=0), 1)))
        prior = np.array([fit_gamma_prior(tally) for tally in tally_rooms(data, every)])
        odds, rate, slope = fit_odds(
            self._move(scores),
            masked.seen.inputs[rooms].astype(np.float64),
            masked.hidden[rooms].astype(np.float64),
            share[rooms],
            prior=prior,
        )
        self.odds.copy_(torch.from_numpy(odds))
        self.rate.copy_(torch.from_numpy(rate))
        self.slope.fill_(slope)

    def predict(self, seen: Observation) -> Expectation:
        """Return the posterior of the hidden counts."""
        inputs, rate = seen.inputs.astype(np.float64), to_array(self.rate)
        odds = to_array(self.odds) + float(self.slope) * self._move(self.score(seen))
        shape = to_shape(np.clip(odds, -_MOST_ODDS, _MOST_ODDS), rate)
        hidden = negative_binomial(*hidden_posterior(shape, rate, inputs, seen.cell_share))
        return from_hidden_counts(inputs, sum_rooms(hidden, seen))

    def _move(self, scores: Floats) -> Floats:
        """Return scores less their means; 0 where nothing is said."""
        return np.nan_to_num(scores - to_array(self.centre), nan=0.0)


def average_others(visible: Bools, table: Floats) -> Floats:
    """Return what the visible classes say of each other one, in the mean, `[N, C]`.

    Args:
        visible: `[N, C]` which classes are seen in each node.
        table: `[C, C]` what the row's class says of the column's; NaN for nothing. The diagonal is
            not read.

    Returns:
        the means; NaN where no other class that says anything is seen.
    """
    table = np.where(np.eye(len(table), dtype=bool), np.nan, table)
    told = visible.astype(np.float64) @ ~np.isnan(table)
    total = visible.astype(np.float64) @ np.nan_to_num(table, nan=0.0)
    return np.divide(total, told, out=np.full_like(total, np.nan), where=told > 0)


def to_shape(odds: Floats, rate: Floats) -> Floats:
    """Return the dispersions k of NB(k, rate b) with these log odds of at least one."""
    return np.asarray(np.logaddexp(0.0, odds) / np.log1p(1 / rate))


def fit_odds(
    moves: Floats, seen: Floats, hidden: Floats, share: Floats, *, prior: Floats
) -> tuple[Floats, Floats, float]:
    """Return odds `[C]`, rates `[C]` and the slope that maximise the likelihood of hidden counts.

    Args:
        moves: `[R, C]` scores of rooms less their means.
        seen: `[R, C]` counts that were seen.
        hidden: `[R, C]` counts that were not.
        share: `[R]` that each room hides, above 0.
        prior: `[C, 2]` shape and rate of every class's Gamma prior, near which few rooms stay.
    """
    classes = seen.shape[1]
    scale = max(float(moves.std()), 1e-9)  # so that a step in any direction is of a like size
    shape, rate = prior.T
    start = np.clip(logit(-np.expm1(-shape * np.log1p(1 / rate))), -_MOST_ODDS, _MOST_ODDS)
    begin = np.concatenate([start, np.log(rate), [0.0]])
    x, v, h = (torch.from_numpy(part) for part in (moves / scale, seen, hidden))
    f, first, some = torch.from_numpy(share)[:, None], torch.from_numpy(begin), h > 0

    def cost(values: Floats) -> tuple[float, Floats]:
        free = torch.from_numpy(values).requires_grad_()
        odds, b = free[:classes] + free[-1] * x, free[classes:-1].exp()
        r = torch.nn.functional.softplus(odds) / torch.log1p(1 / b) + v
        log_p = r * torch.log1p(-f / (b + 1))
        r, log_odds = r[some], (torch.log(f) - torch.log(b + 1))[some]
        more = torch.lgamma(h[some] + r) - torch.lgamma(r) + h[some] * log_odds
        loss = _RIDGE / 2 * ((free - first) ** 2)[:-1].sum() - log_p.sum() - more.sum()
        (gradient,) = torch.autograd.grad(loss, free)
        return float(loss.detach()), gradient.numpy()

    with torch.enable_grad():
        bounds = [(-_MOST_ODDS, _MOST_ODDS)] * classes + [(-9.0, 9.0)] * classes + [(0.0, 20.0)]
        found = minimize(cost, begin, jac=True, method="L-BFGS-B", bounds=bounds).x
    return found[:classes], np.exp(found[classes:-1]), float(found[-1]) / scale


def _uniform(choice: DataConfig) -> DataConfig:
    """Return a choice with uniform masks: what is said of a class shows in rooms that are seen.

    Raises:
        TrainingError: if they hide nothing.
    """
    if not (choice.fractions or (0.0, choice.mask.fraction))[1]:
        raise TrainingError("masks that hide nothing teach nothing: raise data.mask.fraction")
    mask = MaskRecipe(fraction=choice.mask.fraction, seed=choice.mask.seed)
    return choice.model_copy(update={"mask": mask, "withhold": 0.0})
