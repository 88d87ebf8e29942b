"""Calibrate a model: fit a few numbers on the val buildings that correct its confidence.

Three numbers correct the counts: a distribution with means μ and dispersions r becomes one with
means e^shift · μ^slope and dispersions e^spread · r. The order of the classes of a room stays; a
slope below 1 is a temperature above 1.

Two numbers correct the presence, separately for cells that were looked into and those that were
not. The log odds of none hidden, ℓ, become ℓ + shift + slope · ℓ; the remaining probabilities keep
their ratios. The two kinds need separate numbers: where a model saw something it is too confident,
and where it saw nothing it knows the average.
"""

from __future__ import annotations

from abc import abstractmethod
from typing import TYPE_CHECKING

import numpy as np

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.observation.observation import Observation
from bsg_models.arrays import library_of
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.expectation import Expectation, from_hidden_counts
from bsg_models.zoo.model import BeliefModel, ModelInputs, take_cells, to_array
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import ModelConfig

if TYPE_CHECKING:
    from bsg_data.observation.masked_buildings import MaskedBuildings

_PRIOR = 10.0  # weight, in cells' log-likelihood, of the penalty for a line that is off by 1


class CalibratedModel(BeliefModel):
    """A model of the hidden counts that can be calibrated; zeros change nothing."""

    calibration: Floats  # [3] shift, logarithm of the slope, and spread
    # [2, 2] shift and slope of the log odds of none, in cells that were looked into, and in others
    presence_calibration: Floats

    def __init__(self, config: ModelConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.hold(calibration=np.zeros(3), presence_calibration=np.zeros((2, 2)))

    @abstractmethod
    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the uncalibrated hidden counts; rows of buildings are ignored."""

    def predict(self, seen: Observation) -> Expectation:
        """Return the calibrated expectation; a building hides what its rooms hide."""
        calibrated = self.calibrate(self.predict_hidden_counts(seen), seen.cell_share)
        return from_hidden_counts(seen.inputs.astype(np.float64), sum_rooms(calibrated, seen))

    def predict_rooms(
        self, seen: Observation, rows: Ints, columns: Ints | None = None
    ) -> CountDistribution:
        """Return the hidden counts of some rooms, without computing other cells."""
        share = seen.cell_share[rows]
        if columns is not None:
            share = np.take_along_axis(share, columns, axis=1)
        return self.calibrate(self.learned_rooms(seen, rows, columns), share)

    def learned_rooms(
        self, seen: Observation, rows: Ints, columns: Ints | None
    ) -> CountDistribution:
        """Return the uncalibrated hidden counts of some rooms."""
        return take_cells(self.predict_hidden_counts(seen), rows, columns)

    def calibrate(self, learned: CountDistribution, share: Floats) -> CountDistribution:
        """Return the calibrated counts of some cells `[N, A]`, of which a share is hidden."""
        calibrated = recalibrate(learned, to_array(self.calibration))
        lines = to_array(self.presence_calibration)
        if lines.any():
            calibrated = _recalibrate_presence(calibrated, lines, looked_into=share < 1)
        return calibrated.without(share == 0)


def take_sample(masked: MaskedBuildings, *, most: int) -> MaskedBuildings:
    """Return a random sample of masked buildings in their order: all, if they have few nodes.

    It has at most `most` nodes, but one building at least.
    """
    rng = np.random.Generator(np.random.PCG64(0))
    order = np.argsort(rng.random(len(masked)), kind="stable")
    last = np.searchsorted(np.cumsum(np.diff(masked.seen.starts)[order]), most, side="right")
    if last == len(masked):
        return masked
    return masked.take(np.sort(order[: max(last, 1)]))


def recalibrate(distribution: CountDistribution, calibration: Floats) -> CountDistribution:
    """Return the distribution under the three numbers of a calibration, `[3]`."""
    shift, log_slope, spread = calibration.tolist()
    return distribution.recalibrated(shift=shift, slope=float(np.exp(log_slope)), spread=spread)


def fit_calibration(distribution: CountDistribution, hidden: Floats) -> Floats:
    """Return the calibration `[3]` that maximises the likelihood of hidden counts `[N, C]`."""

    def cost(calibration: Floats) -> float:
        return -float(recalibrate(distribution, calibration).log_probability(hidden).mean())

    from scipy.optimize import minimize  # only trainings come here

    minimum = minimize(
        cost, np.zeros(3), method="L-BFGS-B", bounds=[(-1.0, 1.0)] * 3, options={"ftol": 1e-6}
    )
    return np.asarray(minimum.x)


def _recalibrate_presence(
    distribution: CountDistribution, lines: Floats, *, looked_into: Bools
) -> CountDistribution:
    """Return the distribution under the `lines` `[2, 2]`, `looked_into` `[N, C]` or not."""
    xp = library_of(looked_into)
    shift, slope = (xp.where(looked_into, here, away) for here, away in lines.T.tolist())
    return distribution.with_none_likelier(shift + slope * distribution.log_odds_of_none)


def fit_presence_calibration(
    distribution: CountDistribution, hidden: Floats, *, share: Floats
) -> Floats:
    """Return the lines `[2, 2]` that maximise the likelihood of the hidden counts `[N, C]`.

    A line changes the likelihood of a count through its presence only, so this is a logistic
    regression. A weak prior holds a line that few cells determine. Cells that hide nothing (`share`
    `[N, C]` of 0) are not used.
    """
    odds, none = distribution.log_odds_of_none, hidden == 0
    lines = np.zeros((2, 2))
    for line, cells in zip(lines, ((share > 0) & (share < 1), share == 1), strict=True):
        if cells.any():
            line[:] = _fit_line(odds[cells], none[cells])
    return lines


def _fit_line(odds: Floats, none: Bools) -> Floats:
    sign = np.where(none, 1.0, -1.0)

    def cost(line: Floats) -> float:
        mended = odds + line[0] + line[1] * odds
        return float(np.logaddexp(0.0, -sign * mended).sum()) + _PRIOR * float(line @ line)

    from scipy.optimize import minimize

    return np.asarray(minimize(cost, np.zeros(2), method="L-BFGS-B", bounds=[(-1.0, 1.0)] * 2).x)
