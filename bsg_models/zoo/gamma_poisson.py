"""Shrink counts per class: Poisson counts whose rates vary from room to room as a Gamma.

    rate of class c in a room   Λ ~ Gamma(a_c, b_c)
    what is there               T | Λ ~ Poisson(Λ)
    a mask that hides f of it   V | Λ ~ Poisson((1 − f) Λ),  H | Λ ~ Poisson(f Λ), independent
    so                          Λ | V ~ Gamma(a_c + V, b_c + 1 − f)
                                H | V ~ NB(mean f (a_c + V) / (b_c + 1 − f), dispersion a_c + V)

a and b maximise the likelihood of the training rooms' counts, T ~ NB(mean a/b, dispersion a).

With `tilted` J > 0 the prior of the first J true counts is also tilted. A tilted prior can express
that rooms have exactly one object of a class (`bsg_models.belief.negative_binomial`).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from pydantic import Field

from bsg_data.arrays import Floats, Ints
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import negative_binomial
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.negative_binomial import (
    hidden_posterior,
    hidden_tilts,
    log_negative_binomial,
    log_normaliser,
)
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import BeliefModel, ModelInputs
from bsg_models.zoo.room_sums import sum_rooms
from bsg_models.zoo.settings import DataConfig, ModelConfig

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset

Tally = tuple[Ints, Ints]  # distinct counts, rising, and the number of rooms with each


class _GammaPoissonConfig(ModelConfig):
    """Shrink each count to its class: Poisson counts with a Gamma prior fitted per class."""

    family: Literal["gamma-poisson"] = "gamma-poisson"
    tilted: int = Field(default=0, ge=0, le=8)  # J, first counts whose prior is tilted


class _GammaPoissonModel(BeliefModel):
    """Shrink each room's counts to its class; the building is the sum of its rooms."""

    by_seed = False
    shape: Floats  # [C] a of the Gamma prior
    rate: Floats  # [C] b of the Gamma prior
    tilts: Floats  # [J, C] log factors of the first true counts; only with `tilted`

    config: _GammaPoissonConfig

    def __init__(self, config: _GammaPoissonConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        self.hold(shape=np.ones(inputs.classes), rate=np.ones(inputs.classes))
        if config.tilted:
            self.hold(tilts=np.zeros((config.tilted, inputs.classes)))

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Fit the prior of every class to the counts of the training rooms."""
        tallies = tally_rooms(data, scenes_of(data, "train", fold=choice.fold))
        fitted = np.array([fit_gamma_prior(tally) for tally in tallies])
        if self.config.tilted:
            starts = zip(tallies, fitted, strict=True)
            fitted = np.array(
                [
                    _fit_tilted_prior(tally, a, b, tilted=self.config.tilted)
                    for tally, (a, b) in starts
                ]
            )
            self.hold(tilts=fitted[:, 2:].T)
        self.hold(shape=fitted[:, 0], rate=fitted[:, 1])

    def predict(self, seen: Observation) -> Expectation:
        """Return the posterior of the hidden counts."""
        inputs, share = seen.inputs.astype(np.float64), seen.cell_share
        hidden = negative_binomial(*hidden_posterior(self.shape, self.rate, inputs, share))
        if self.config.tilted:
            tilts = hidden_tilts(self.tilts[:, None], inputs)
            hidden = replace(hidden, tilts=np.stack(tilts)[:, None]).without(share == 0)
        return Expectation(inputs, sum_rooms(hidden, seen))


def tally_rooms(data: Dataset, scenes: Sequence[str]) -> list[Tally]:
    """Return for every class `[C]` which counts occur in rooms, and in how many rooms each.

    Rooms whose source has no word for a class are left out; if all are, it is absent in one.
    """
    tallies = [Counter[int]() for _ in data.manifest.class_space.classes]
    for some in data.in_shards(scenes):
        rooms = np.concatenate([data.cells(scene)[1:] for scene in some])
        sizes = [len(data.cells(scene)) - 1 for scene in some]
        known = np.repeat([data.nameable(scene) for scene in some], sizes, axis=0)
        for tally, counts, own in zip(tallies, rooms.T, known.T, strict=True):
            values, times = np.unique(counts[own], return_counts=True)
            tally.update(dict(zip(values.tolist(), times.tolist(), strict=True)))
    every = [tally or Counter({0: 1}) for tally in tallies]
    both = [np.array(sorted(tally.items()), dtype=np.int64).reshape(-1, 2) for tally in every]
    return [(values_times[:, 0], values_times[:, 1]) for values_times in both]


def fit_gamma_prior(tally: Tally) -> tuple[float, float]:
    """Return (a, b) that maximise the likelihood of a class's counts as a Gamma-Poisson mixture.

    A class that never occurs gets a prior as weak as half an object in all rooms together.
    """
    values, times = tally
    mean = max(float(values @ times) / float(times.sum()), 0.5 / float(times.sum()))

    def cost(log_shape: Floats) -> float:
        a = float(np.exp(log_shape[0]))
        return -float(times @ log_negative_binomial(values, mean, a))

    from scipy.optimize import minimize  # only trainings come here

    minimum = minimize(cost, x0=np.zeros(1), bounds=[(-8.0, 8.0)], method="L-BFGS-B")
    a = float(np.exp(minimum.x[0]))
    return a, a / mean


def _fit_tilted_prior(tally: Tally, shape: float, rate: float, *, tilted: int) -> tuple[float, ...]:
    """Return a, b and the J tilts that maximise the likelihood of a class, from initial a and b.

    Each tilt has a normal prior of standard deviation 2, which limits the tilts of rare counts.
    """
    values, times = tally
    rooms = int(times.sum())

    def cost(parameters: Floats) -> float:
        a, mean = np.exp(parameters[:2])
        tilts = parameters[2:]
        small = values < tilted
        likelihood = float(times @ log_negative_binomial(values, mean, a))
        likelihood += float(times[small] @ tilts[values[small]])
        likelihood -= rooms * float(log_normaliser(tilts, mean, a))
        return float(tilts @ tilts) / 8 - likelihood

    start = np.concatenate([np.log([shape, shape / rate]), np.zeros(tilted)])
    bounds = [(-8.0, 8.0), (-12.0, 5.0)] + [(-5.0, 5.0)] * tilted
    from scipy.optimize import minimize

    best = minimize(cost, start, method="L-BFGS-B", bounds=bounds).x
    a, mean = np.exp(best[:2])
    return float(a), float(a / mean), *best[2:].tolist()


GAMMA_POISSON = ZooRow(_GammaPoissonConfig(), _GammaPoissonModel)
TILTED_GAMMA_POISSON = ZooRow(
    _GammaPoissonConfig(tilted=2),
    _GammaPoissonModel,
    summary="Shrink each count to its class, with a prior that also fits P(none) and P(one).",
)
