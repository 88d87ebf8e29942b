"""Turn scores of presence into distributions of counts, so that other methods can be compared.

A method gives a score s to a class in a room: a cosine, a log co-occurrence, or an entry of a
table. The score scores the odds that the room has the class at all:

    logit P(T > 0) = o_c + β (s − s̄_c)             s̄ the mean score, o_c and β fitted
    T ~ NB(dispersion k, rate b_c)                  k = −log P(T = 0) / log(1 + 1 / b_c)
    H | V ~ NB(mean f (k + V) / (b_c + 1 − f), dispersion k + V)

T is the true count, V the seen and H the hidden one. NB(k, b) is a Poisson number of clusters whose
sizes do not depend on k, so a likelier class has more clusters of the usual size. It is also a
Poisson with the prior Gamma(k, b), so the last line, Bayes' rule, holds at every share f: at 0
nothing is hidden, and at 1 it is the prior. The score of a class uses only the *other* classes,
because V already counts the class itself. A score without evidence, as in a room that nobody looked
into, changes nothing.

o, b and the single slope β maximise the likelihood of the hidden counts of masked training rooms. A
slope is never below 0: a misleading score is ignored, not inverted.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Sequence
from typing import TYPE_CHECKING

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.observation.masked_buildings import (
    MaskedBuildings,
    sample_masked,
    stack_masked,
    vary_fractions,
)
from bsg_data.observation.observation import Observation
from bsg_data.recipes import MaskRecipe
from bsg_models.belief.count_distribution import negative_binomial
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.negative_binomial import hidden_posterior
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.gamma_poisson import fit_gamma_prior, tally_rooms
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import DataConfig, ModelConfig

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset

# The visible share varies, so that a model works at any share.
ANY_FRACTION = DataConfig(fractions=(0.1, 0.9))
_DRAWS = 3  # masks of every training building
_MOST_ODDS = 12.0  # limit of the log odds of a presence, beyond which nothing changes
_RIDGE = 1.0  # keeps parameters that few rooms determine near the prior


class PresenceOdds(BeliefModel):
    """A score of presence, turned into a distribution of the hidden counts."""

    odds: Floats  # [C] o, log odds that a room has the class
    rate: Floats  # [C] b of the Gamma prior
    centre: Floats  # [C] s̄, the mean score in training rooms
    slope: Floats  # β

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        none = np.zeros(inputs.classes)
        self.hold(odds=none, rate=none + 1, centre=none, slope=0.0)

    @abstractmethod
    def read_knowledge(self, classes: tuple[str, ...]) -> None:
        """Read the source of the scores for these classes `[C]` into buffers."""

    @abstractmethod
    def score(self, seen: Observation) -> Floats:
        """Return the scores `[N, C]` of each class from the others; NaN without evidence."""

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Fit odds, rates and the slope on masks of the training rooms."""
        self.read_knowledge(data.manifest.class_space.classes)
        scenes = scenes_of(data, "train", fold=choice.fold)
        masked = _mask_uniformly(data, choice, scenes)
        share = masked.seen.hidden_share.astype(np.float64)
        rooms = ~masked.seen.is_building & (share > 0)
        scores = self.score(masked.seen)[rooms]
        known = ~np.isnan(scores)
        total = np.where(known, scores, 0.0).sum(axis=0)
        self.hold(centre=total / np.maximum(known.sum(axis=0), 1))
        odds, rate, slope = fit_odds(
            self._centred(scores),
            masked.seen.inputs[rooms].astype(np.float64),
            masked.hidden[rooms].astype(np.float64),
            share[rooms],
            prior=np.array([fit_gamma_prior(tally) for tally in tally_rooms(data, scenes)]),
        )
        self.hold(odds=odds, rate=rate, slope=slope)

    def predict(self, seen: Observation) -> Expectation:
        """Return the posterior of the hidden counts."""
        inputs, rate = seen.inputs.astype(np.float64), self.rate
        odds = self.odds + float(self.slope) * self._centred(self.score(seen))
        shape = to_shape(np.clip(odds, -_MOST_ODDS, _MOST_ODDS), rate)
        hidden = negative_binomial(*hidden_posterior(shape, rate, inputs, seen.cell_share))
        return Expectation(inputs, sum_rooms(hidden, seen))

    def _centred(self, scores: Floats) -> Floats:
        """Return scores minus their means; 0 without evidence."""
        return np.nan_to_num(scores - self.centre, nan=0.0)


def average_others(visible: Bools, table: Floats) -> Floats:
    """Return the mean of the visible classes' values for each other class, `[N, C]`.

    It is NaN if no other class with a value is visible `[N, C]`. The table `[C, C]` has the value
    of the row's class for the column's, NaN for none; its diagonal is not read.
    """
    table = np.where(np.eye(len(table), dtype=bool), np.nan, table)
    number = visible.astype(np.float64) @ ~np.isnan(table)
    total = visible.astype(np.float64) @ np.nan_to_num(table, nan=0.0)
    return np.divide(total, number, out=np.full_like(total, np.nan), where=number > 0)


def to_shape(odds: Floats, rate: Floats) -> Floats:
    """Return the dispersions k of NB(k, rate b) with these log odds of at least one."""
    return np.asarray(np.logaddexp(0.0, odds) / np.log1p(1 / rate))


def fit_odds(
    scores: Floats, seen: Floats, hidden: Floats, share: Floats, *, prior: Floats
) -> tuple[Floats, Floats, float]:
    """Return odds `[C]`, rates `[C]` and the slope that maximise the likelihood of hidden counts.

    Scores minus their means, seen and hidden counts are `[R, C]`; the share `[R]` is above 0. Rare
    classes stay near the `prior`: shape and rate of every class's Gamma, `[C, 2]`.
    """
    import torch  # only trainings come here
    from scipy.optimize import minimize
    from scipy.special import logit

    classes = seen.shape[1]
    scale = max(float(scores.std()), 1e-9)  # so that steps in all directions have similar sizes
    shape, rate = prior.T
    start = np.clip(logit(-np.expm1(-shape * np.log1p(1 / rate))), -_MOST_ODDS, _MOST_ODDS)
    begin = np.concatenate([start, np.log(rate), [0.0]])
    x, v, h = (torch.from_numpy(part) for part in (scores / scale, seen, hidden))
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


def _mask_uniformly(data: Dataset, choice: DataConfig, scenes: Sequence[str]) -> MaskedBuildings:
    """Return buildings under uniform masks: only partly seen rooms show what classes say."""
    if not (choice.fractions or (0.0, choice.mask.fraction))[1]:
        raise TrainingError("masks that hide nothing teach nothing: raise data.mask.fraction")
    mask = MaskRecipe(fraction=choice.mask.fraction, seed=choice.mask.seed)
    return stack_masked(
        [
            sample_masked(
                data,
                scenes,
                mask=vary_fractions(mask, choice.fractions, draw, len(scenes)),
                draw=draw,
            )
            for draw in range(_DRAWS)
        ]
    )
