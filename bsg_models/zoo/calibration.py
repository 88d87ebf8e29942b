"""Calibrate a model: fit a few numbers on the val buildings that correct its confidence.

Three numbers correct the counts: a distribution with means μ and dispersions r becomes one with
means e^shift · μ^slope and dispersions e^spread · r. The order of the classes of a room stays; a
slope below 1 is a temperature above 1.

Two numbers correct the presence, separately for cells that were looked into and those that were
not. The log odds of none hidden, ℓ, become ℓ + shift + slope · ℓ; the remaining probabilities keep
their ratios. The two kinds need separate numbers: where a model saw something it is too confident,
and where it saw nothing it knows the average.

At last, a tilt of what whole buildings hide makes their rooms depend on each other
(`bsg_models.zoo.building_tilt`).
"""

from __future__ import annotations

import copy
import math
from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.observation.observation import Observation
from bsg_models.arrays import library_of
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.negative_binomial import TINY
from bsg_models.zoo.building_tilt import (
    fit_odds,
    log_none_of,
    log_odds,
    share_to_tilt,
    tilt,
)
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import ModelConfig

if TYPE_CHECKING:
    from bsg_data.observation.masked_buildings import MaskedBuildings

_SURE = -math.log(1e-9)  # log odds beyond which all presences are alike
_PRIOR = 10.0  # weight, in cells' log-likelihood, of the penalty for a line that is off by 1


class CalibratedModel(BeliefModel):
    """A model of the hidden counts that can be calibrated; zeros change nothing."""

    calibration: Floats  # [3] shift, logarithm of the slope, and spread
    # [2, 2] shift and slope of the log odds of none, in cells that were looked into, and in others
    presence_calibration: Floats
    # [2, 3, C] line of the tilt of a building, for classes of which none was seen there, and others
    building_calibration: Floats

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.hold(
            calibration=np.zeros(3),
            presence_calibration=np.zeros((2, 2)),
            building_calibration=np.zeros((2, 3, inputs.classes)),
        )

    @abstractmethod
    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the uncalibrated hidden counts; rows of buildings are ignored."""

    def predict(self, seen: Observation) -> Expectation:
        """Return the calibrated expectation; a building hides what its rooms hide."""
        share, factor = seen.cell_share, None
        rooms = self.calibrate(self.predict_hidden_counts(seen), share)
        tilted = self._share_to_tilt(seen)
        if tilted.any():
            is_room, factor = ~seen.is_building, np.empty(share.shape)
            factor[seen.starts[:-1]], factor[is_room] = self._tilt(
                rooms.presence[is_room], seen.building[is_room], seen, tilted
            )
            factor = np.where(share > 0, factor, 0.0)
        whole = sum_rooms(rooms, seen, log_factor=factor)
        return Expectation(seen.inputs.astype(np.float64), whole)

    def predict_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the hidden counts of some rooms, without computing cells that change nothing."""
        tilted = self._share_to_tilt(seen)
        if not tilted.any():
            return self._calibrate_rooms(seen, rows)
        every = _add_neighbours(seen, rows)
        apart = self._calibrate_rooms(seen, every)
        _, factors = self._tilt(apart.presence, seen.building[every], seen, tilted)
        tilted_rooms = apart.with_none_likelier(np.where(apart.presence > 0, factors, 0.0))
        return tilted_rooms.take(np.searchsorted(every, rows))

    def with_independent_rooms(self) -> CalibratedModel:
        """Return it without the tilt of buildings."""
        apart = copy.copy(self)
        apart.building_calibration = np.zeros_like(self.building_calibration)
        return apart

    def _share_to_tilt(self, seen: Observation) -> Floats:
        """Return the share of the tilt that B buildings get, `[B, 1]`."""
        if not self.building_calibration.any():
            return np.zeros((len(seen), 1))
        return share_to_tilt(seen, reads_labels=self.reads_labels)

    def _tilt(
        self, presence: Floats, building: Ints, seen: Observation, tilted: Floats
    ) -> tuple[Floats, Floats]:
        """Return tilts of buildings `[B, C]`, and log factors of none of their rooms `[M, C]`.

        A share `[B, 1]` is tilted.
        """
        found = seen.inputs[seen.starts[:-1]] > 0
        line = self.building_calibration[:, :, None]
        tilts, _, factors = tilt(presence, building, found, line, tilted)
        return tilts, factors

    def _calibrate_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the hidden counts of some rooms as if they were independent."""
        return self.calibrate(self.learned_rooms(seen, rows), seen.cell_share[rows])

    def learned_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the uncalibrated hidden counts of some rooms."""
        return self.predict_hidden_counts(seen).take(rows)

    def calibrate(self, learned: CountDistribution, share: Floats) -> CountDistribution:
        """Return the calibrated counts of some cells `[N, A]`, of which a share is hidden."""
        calibrated, lines = learned.recalibrated(self.calibration), self.presence_calibration
        if lines.any():
            calibrated = _recalibrate_presence(calibrated, lines, looked_into=share < 1)
        return calibrated.without(share == 0)


def _add_neighbours(seen: Observation, rows: Ints) -> Ints:
    """Return rooms, and all others of their buildings that may hide something, in order."""
    asked = np.zeros(len(seen), dtype=bool)
    asked[seen.building[rows]] = True
    hides = (seen.cell_share > 0).any(axis=1) & ~seen.is_building & asked[seen.building]
    hides[rows] = True
    return np.flatnonzero(hides)


def take_sample(masked: MaskedBuildings, *, limit: int) -> MaskedBuildings:
    """Return a random sample of masked buildings in their order: all, if they have few nodes.

    It has at most `limit` nodes, but one building at least.
    """
    rng = np.random.Generator(np.random.PCG64(0))
    order = np.argsort(rng.random(len(masked)), kind="stable")
    last = np.searchsorted(np.cumsum(np.diff(masked.seen.starts)[order]), limit, side="right")
    if last == len(masked):
        return masked
    return masked.take(np.sort(order[: max(last, 1)]))


def fit_calibration(distribution: CountDistribution, hidden: Floats) -> Floats:
    """Return the calibration `[3]` that maximises the likelihood of hidden counts `[N, C]`."""
    log_means = np.log(np.maximum(distribution.means, TINY))

    def cost(calibration: Floats) -> tuple[float, Floats]:
        log_p, by_mean, by_dispersion = distribution.recalibrated(
            calibration
        ).log_probability_slopes(hidden)
        by_slope = np.exp(calibration[1]) * np.vdot(by_mean, log_means)
        slopes = np.array([by_mean.sum(), by_slope, by_dispersion.sum()])
        return -float(log_p.mean()), -slopes / log_p.size

    from scipy.optimize import minimize  # only trainings come here

    minimum = minimize(
        cost,
        np.zeros(3),
        jac=True,
        method="L-BFGS-B",
        bounds=[(-1.0, 1.0)] * 3,
        options={"ftol": 1e-6},
    )
    return np.asarray(minimum.x)


def _recalibrate_presence(
    distribution: CountDistribution, lines: Floats, *, looked_into: Bools
) -> CountDistribution:
    """Return the distribution under the `lines` `[2, 2]`, `looked_into` `[N, C]` or not."""
    xp = library_of(looked_into)
    shift, slope = (xp.where(looked_into, here, away) for here, away in lines.T.tolist())
    return distribution.with_none_likelier(shift + slope * _log_odds_of_none(distribution))


def _log_odds_of_none(distribution: CountDistribution) -> Floats:
    odds: Floats = log_odds(log_none_of(distribution.presence), limit=_SURE)
    return odds


def fit_presence_calibration(
    distribution: CountDistribution, hidden: Floats, *, share: Floats
) -> Floats:
    """Return the lines `[2, 2]` that maximise the likelihood of the hidden counts `[N, C]`.

    A line changes the likelihood of a count through its presence only, so this is a logistic
    regression. A weak prior holds a line that few cells determine. Cells that hide nothing (`share`
    `[N, C]` of 0) are not used.
    """
    odds, none = _log_odds_of_none(distribution), hidden == 0
    lines, prior = np.zeros((2, 2)), np.full(2, _PRIOR)
    for line, cells in zip(lines, ((share > 0) & (share < 1), share == 1), strict=True):
        if cells.any():
            own = odds[cells]
            design = np.stack([np.ones_like(own), own], axis=1)
            line[:] = fit_odds(own, none[cells], design, prior=prior, limit=1.0)
    return lines
