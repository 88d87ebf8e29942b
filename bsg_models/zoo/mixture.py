"""Latent room types: what kind of room is this, and what does that kind hold?

    type of a room              k ~ π
    count of class c in it      T | k ~ NB(mean m_kc, dispersion r_kc), independent given k
    a mask that hides f of it   V | T ~ Binomial(T, 1 − f), H = T − V
    so                          P(k | V) ∝ π_k Π_c NB(V_c; (1 − f) m_kc, r_kc)^τ
                                H | V, k ~ NB(f (r + V) / (r / m + 1 − f), r + V)

π, m and r are fitted to the training rooms by expectation maximisation. τ < 1 (`temper`) because
the classes of a room are not independent given its type, so that the product alone is too sure.

The building is a second level (`building`). Its habits show in the *other* rooms that
were looked into:

    which types it has          π_b ∝ η π + Σ P(k | V) over the other rooms
    how much of class c         g_bc = (α_c + Σ V_c) / (α_c + Σ E V_c), the mean of a
                                Gamma(α_c, α_c) given the other rooms; it multiplies m_kc

and every room is answered again with π_b and g_b m.

With `tilted` J > 0 the prior of the first J counts of every type is tilted
(`bsg_models.belief.negative_binomial`), so that a type knows of what it has just one. m is then the
mean before tilts; E V is that of the tilted counts. In a room that nobody looked into f is 1 and V
says nothing: the answer is the building's types and habits. f is that of the class where one is
withheld.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
import numpy.typing as npt
import torch
from pydantic import Field
from scipy.optimize import minimize_scalar
from scipy.special import logsumexp

from bsg_data.arrays import Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.observation import Observation
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.negative_binomial import (
    first_counts,
    hidden_posterior,
    hidden_tilts,
    log_beyond_none,
    log_negative_binomial,
    log_none,
    log_normaliser,
)
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.model import ModelInputs, to_array
from bsg_models.zoo.settings import DataConfig, ModelConfig

_MOST = 60  # objects of one class in one room that the fit tells apart
_LEAST = 1e-9  # no type calls a class impossible
_LOG_SHAPE = 4.0  # |log r| at most; its prior is a standard normal
_PRIOR_ROOMS = 2.0  # mean rooms that every type's means are shrunk towards
_TILT_ROOMS = 40.0  # rooms that every type's tilts are shrunk towards none by
_MOST_TILT = 5.0
_PRIOR_TYPES = 8.0  # η: rooms of an average building that π_b starts from


class MixtureConfig(ModelConfig):
    """Latent room types with negative-binomial counts, fitted by expectation maximisation.

    Attributes:
        types: number of room types.
        iterations: of expectation maximisation.
        temper: exponent on the likelihood of what is seen; below 1, since the classes of a room
            are not as independent as a type says.
        building: whether the other rooms of a building tell its types and habits.
        tilted: J, of how many first counts the prior of a type is tilted.
        calibrate: fit a few numbers on the val buildings that mend how sure the model is.
    """

    family: Literal["mixture"] = "mixture"
    types: int = Field(default=16, ge=1, le=1000)
    iterations: int = Field(default=60, ge=1, le=10_000)
    temper: float = Field(default=0.85, gt=0, le=1)
    building: bool = True
    tilted: int = Field(default=2, ge=0, le=8)
    calibrate: bool = True


class RoomTypeMixture(CalibratedModel):
    """Fitted by counting; its posterior is in closed form.

    Attributes:
        log_types: `[K]` log π.
        means: `[K, C]` m.
        dispersions: `[K, C]` r.
        habits: `[C]` α; large where buildings do not differ.
        tilts: `[J, K, C]` log factors of the first counts; only with `tilted`.
    """

    log_types: torch.Tensor
    means: torch.Tensor
    dispersions: torch.Tensor
    habits: torch.Tensor
    tilts: torch.Tensor

    config: MixtureConfig

    def __init__(self, config: MixtureConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        shape = (config.types, inputs.classes)
        self.register_buffer("log_types", torch.zeros(config.types, dtype=torch.float64))
        self.register_buffer("means", torch.ones(shape, dtype=torch.float64))
        self.register_buffer("dispersions", torch.ones(shape, dtype=torch.float64))
        self.register_buffer("habits", torch.ones(inputs.classes, dtype=torch.float64))
        if config.tilted:
            tilts = torch.zeros((config.tilted, *shape), dtype=torch.float64)
            self.register_buffer("tilts", tilts)

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Fit types, and how much buildings differ, to the rooms of the training buildings."""
        scenes = scenes_of(data, "train", fold=choice.fold)
        rooms = [np.minimum(data.cells(scene)[1:], _MOST) for scene in scenes]
        counts = np.concatenate(rooms)
        if len(counts) < self.config.types:
            raise TrainingError(
                f"{len(counts)} training rooms are too few for {self.config.types} room types; "
                "lower model.types"
            )
        seed = int(torch.randint(2**31, (1,)).item())  # torch was seeded with the run's seed
        fitted = fit_types(
            counts,
            types=self.config.types,
            iterations=self.config.iterations,
            seed=seed,
            tilted=self.config.tilted,
        )
        of_building = np.repeat(np.arange(len(rooms)), [len(one) for one in rooms])
        totals, expected = np.zeros((2, len(rooms), counts.shape[1]))
        np.add.at(totals, of_building, counts)
        np.add.at(expected, of_building, fitted.belonging @ fitted.expected)
        habits = [fit_habit(t, e) for t, e in zip(totals.T, expected.T, strict=True)]
        self.log_types.copy_(torch.from_numpy(fitted.log_types))
        self.means.copy_(torch.from_numpy(fitted.means))
        self.dispersions.copy_(torch.from_numpy(fitted.dispersions))
        self.habits.copy_(torch.from_numpy(np.array(habits)))
        if self.config.tilted:
            self.tilts.copy_(torch.from_numpy(fitted.tilts))

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the posterior of the hidden counts of every room, K components."""
        is_room = ~seen.is_building
        evidence = _Evidence(
            seen=seen.inputs[is_room].astype(np.float64),
            share=seen.cell_share[is_room],
            looked_into=seen.looked_into[is_room],
            building=seen.building[is_room],
        )
        means = to_array(self.means)[:, None]
        types = np.broadcast_to(to_array(self.log_types)[:, None], (len(means), is_room.sum()))
        posterior = self._posterior(evidence, types, means)
        if self.config.building:
            types, habit = self._learn_habits(evidence, posterior.weights[..., 0])
            posterior = self._posterior(evidence, types, means * habit)
        return _spread_over_nodes(posterior, is_room)

    def _posterior(
        self, evidence: _Evidence, log_types: Floats, means: Floats
    ) -> CountDistribution:
        """Return the hidden counts given the prior of types `[K, rooms]` and their means."""
        r = to_array(self.dispersions)[:, None]
        hidden, dispersions = hidden_posterior(r, r / means, evidence.seen, evidence.share)
        dispersions = np.broadcast_to(dispersions, hidden.shape)
        log_seen = self._log_seen(evidence, means)
        tilts = None
        if self.config.tilted:
            prior = to_array(self.tilts)[:, :, None]
            tilts = np.stack(hidden_tilts(prior, evidence.seen))
            log_seen += log_normaliser(tilts, hidden, dispersions).sum(axis=2)
            log_seen -= log_normaliser(prior, means, r).sum(axis=2)
        log_posterior = log_types + self.config.temper * log_seen * evidence.looked_into
        log_posterior -= logsumexp(log_posterior, axis=0)
        weights = np.exp(log_posterior)[:, :, None]
        return CountDistribution(hidden, dispersions, weights, tilts)

    def _log_seen(self, evidence: _Evidence, means: Floats) -> Floats:
        """Return log NB(what was seen) of every type without tilts, `[K, rooms]`."""
        kept = 1 - evidence.share
        rows, columns = np.nonzero(evidence.seen)
        seen = evidence.seen[rows, columns]
        log_seen = np.empty((len(means), len(evidence.seen)))
        for k, r in enumerate(to_array(self.dispersions)):
            mean = np.maximum(kept * means[k], _LEAST)
            log_seen[k] = log_none(mean, r).sum(axis=1)
            np.add.at(log_seen[k], rows, log_beyond_none(seen, mean[rows, columns], r[columns]))
        return log_seen

    def _learn_habits(self, evidence: _Evidence, posterior: Floats) -> tuple[Floats, Floats]:
        """Return log π_b `[K, rooms]` and g_b `[rooms, C]`, from the other rooms."""
        looked_into = evidence.looked_into[:, None].astype(float)
        belonging = posterior.T * looked_into
        expected = (1 - evidence.share) * (belonging @ self._expected())
        of_others = [
            _sum_others(values, evidence.building)
            for values in (belonging, evidence.seen * looked_into, expected)
        ]
        types = of_others[0] + _PRIOR_TYPES * np.exp(to_array(self.log_types))
        habit = to_array(self.habits)
        gain = (habit + of_others[1]) / (habit + of_others[2])
        return np.log(types / types.sum(axis=1, keepdims=True)).T, gain

    def _expected(self) -> Floats:
        """Return the mean counts of every type with its tilts, `[K, C]`."""
        tilts = to_array(self.tilts) if self.config.tilted else None
        return tilted_means(to_array(self.means), to_array(self.dispersions), tilts)


@dataclass(frozen=True, eq=False)
class _Evidence:
    """What rooms show.

    Attributes:
        seen: `[rooms, C]`.
        share: `[rooms, C]` that is hidden.
        looked_into: `[rooms]` whether anything of them could be seen.
        building: `[rooms]` number of the building.
    """

    seen: Floats
    share: Floats
    looked_into: npt.NDArray[np.bool_]
    building: Ints


@dataclass(frozen=True, eq=False)
class FittedTypes:
    """What expectation maximisation comes to, with K types, C classes and R rooms.

    Attributes:
        log_types: log π `[K]`.
        means: m `[K, C]`, before tilts.
        dispersions: r `[K, C]`.
        tilts: `[J, K, C]`.
        belonging: P(type | room) `[R, K]`.
    """

    log_types: Floats
    means: Floats
    dispersions: Floats
    tilts: Floats
    belonging: Floats

    @property
    def expected(self) -> Floats:
        """Mean counts with tilts, `[K, C]`."""
        return tilted_means(self.means, self.dispersions, self.tilts)


def fit_types(
    counts: Ints, *, types: int, iterations: int, seed: int, tilted: int = 0
) -> FittedTypes:
    """Fit a mixture of tilted negative binomials to complete rooms by expectation maximisation.

    Each round fits the negative binomials as if there were no tilts, and then the tilts to what
    they leave. That is not quite the maximum of the likelihood, but both steps are in closed form
    or nearly so, and neither lets a rare type believe what a few rooms show.

    Args:
        counts: `[R, C]`.
        types: K.
        iterations: of the algorithm.
        seed: of its start, rooms grouped around K random ones.
        tilted: J.
    """
    rooms, classes = counts.shape
    values = np.arange(max(int(counts.max(initial=0)) + 1, tilted))
    # One row a room, one column a (class, count): all sums over rooms become matrix products.
    indicator = (counts[:, :, None] == values).astype(np.float32).reshape(rooms, -1)
    overall = np.maximum(counts.mean(axis=0), 0.5 / rooms)
    belonging = _group(np.log1p(counts), types, seed=seed)
    dispersions = np.ones((types, classes))
    tilts = np.zeros((tilted, types, classes))
    for _ in range(iterations):
        size = belonging.sum(axis=0)
        log_types = np.log((size + 1) / (rooms + types))
        means = (belonging.T @ counts + _PRIOR_ROOMS * overall) / (size[:, None] + _PRIOR_ROOMS)
        frequency = (belonging.T.astype(np.float32) @ indicator).reshape(types, classes, -1)
        dispersions = _improve_dispersions(dispersions, means, frequency.astype(float), values)
        table = log_negative_binomial(values, means[..., None], dispersions[..., None])
        tilts = _fit_tilts(table, frequency.astype(float), tilted)
        table[..., :tilted] += np.moveaxis(tilts, 0, -1)
        table -= log_normaliser(tilts, means, dispersions)[..., None]
        log_joint = log_types + indicator @ table.reshape(types, -1).T.astype(np.float32)
        belonging = np.exp(log_joint - logsumexp(log_joint, axis=1, keepdims=True))
    return FittedTypes(log_types, means, dispersions, tilts, belonging)


def _fit_tilts(table: Floats, frequency: Floats, tilted: int) -> Floats:
    """Return the tilts `[J, K, C]` that give the first counts their shares of the rooms.

    The shares are shrunk towards those without tilts, by as many rooms as `_TILT_ROOMS`.

    Args:
        table: `[K, C, values]` log probabilities of the counts without tilts.
        frequency: `[K, C, values]` weight of the rooms with each count.
        tilted: J.
    """
    first = np.exp(table[..., :tilted])
    beyond = np.maximum(1 - first.sum(axis=-1), 1e-9)
    weights = frequency[..., :tilted] + _TILT_ROOMS * first
    rest = frequency[..., tilted:].sum(axis=-1) + _TILT_ROOMS * beyond
    gain = np.log(weights / first) - np.log(rest / beyond)[..., None]
    return np.moveaxis(np.clip(gain, -_MOST_TILT, _MOST_TILT), -1, 0)


def tilted_means(means: Floats, dispersions: Floats, tilts: Floats | None) -> Floats:
    """Return the means of tilted negative binomials; `tilts` has counts as its first axis."""
    if tilts is None or not len(tilts):
        return means
    first = first_counts(len(tilts), np.exp(log_none(means, dispersions)), means, dispersions)
    gained = sum(t * p * np.expm1(a) for t, (p, a) in enumerate(zip(first, tilts, strict=True)))
    return np.asarray((means + gained) * np.exp(-log_normaliser(tilts, means, dispersions)))


def fit_habit(totals: Floats, expected: Floats) -> float:
    """Return α of one class: buildings hold NB(expected, dispersion α) of it; both `[B]`."""

    def cost(log_shape: float) -> float:
        shape = float(np.exp(log_shape))
        return -float(log_negative_binomial(totals, np.maximum(expected, 1e-9), shape).sum())

    minimum = minimize_scalar(cost, bounds=(-3.0, 8.0), method="bounded")
    return float(np.exp(minimum.x))


def _improve_dispersions(r: Floats, mean: Floats, frequency: Floats, values: Ints) -> Floats:
    """Return dispersions `[K, C]` after Newton steps in log r on the weighted likelihood.

    Args:
        r: `[K, C]`.
        mean: `[K, C]`.
        frequency: `[K, C, values]` weight of the rooms with each count.
        values: the counts.
    """
    for _ in range(3):
        s, m = r[..., None], mean[..., None]
        steps = 1 / (s + values[:-1])  # sums of these are the differences of the digamma function
        first = _sum_before(steps) - np.log1p(m / s) + (m - values) / (m + s)
        second = m / (s * (m + s)) - _sum_before(steps**2) - (m - values) / (m + s) ** 2
        slope = (frequency * first).sum(axis=-1) * r
        bend = (frequency * second).sum(axis=-1) * r**2 + slope
        log_r = np.log(r)
        slope, bend = slope - log_r, np.where(bend < 0, bend, -np.abs(bend)) - 1  # the prior
        r = np.exp(np.clip(log_r - np.clip(slope / bend, -1, 1), -_LOG_SHAPE, _LOG_SHAPE))
    return r


def _sum_before(steps: Floats) -> Floats:
    """Return 0 and the running sums over the last axis: `[..., n]` to `[..., n + 1]`."""
    sums = np.cumsum(steps, axis=-1)
    return np.concatenate([np.zeros_like(sums, shape=(*sums.shape[:-1], 1)), sums], axis=-1)


def _group(points: Floats, groups: int, *, seed: int) -> Floats:
    """Return soft memberships `[R, K]` after ten rounds of k-means from random points."""
    rng = np.random.Generator(np.random.PCG64(seed))
    centres = points[rng.choice(len(points), groups, replace=len(points) < groups)]
    for _ in range(10):
        distance = ((points**2).sum(1)[:, None] - 2 * points @ centres.T) + (centres**2).sum(1)
        nearest = distance.argmin(axis=1)
        for group in np.unique(nearest):
            centres[group] = points[nearest == group].mean(axis=0)
    return np.asarray(0.9 * np.eye(groups)[nearest] + 0.1 / groups)


def _sum_others(values: Floats, building: Ints) -> Floats:
    """Return the sum over the other rooms of each room's building, `[rooms, ...]`."""
    sums = np.zeros((int(building.max(initial=-1)) + 1, values.shape[1]))
    np.add.at(sums, building, values)
    return np.asarray(np.maximum(sums[building] - values, 0.0))


def _spread_over_nodes(
    distribution: CountDistribution, is_room: npt.NDArray[np.bool_]
) -> CountDistribution:
    """Put the rooms' distribution into that of all nodes; buildings get a placeholder."""
    shape = (len(distribution.means), len(is_room))
    means, weights = (
        np.zeros((*shape, distribution.means.shape[2])),
        np.full((*shape, 1), 1 / shape[0]),
    )
    dispersions = np.ones_like(means)
    means[:, is_room], dispersions[:, is_room] = distribution.means, distribution.dispersions
    weights[:, is_room] = distribution.weights
    if distribution.tilts is None:
        return CountDistribution(means, dispersions, weights)
    tilts = np.zeros((len(distribution.tilts), *means.shape))
    tilts[:, :, is_room] = distribution.tilts
    return CountDistribution(means, dispersions, weights, tilts)


MIXTURE = ZooRow(MixtureConfig(), RoomTypeMixture)
