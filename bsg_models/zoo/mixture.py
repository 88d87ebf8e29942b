"""Model latent room types: infer the type of a room, and predict what rooms of that type hold.

    type of a room              k ~ π
    count of class c in it      T | k ~ NB(mean m_kc, dispersion r_kc), independent given k
    a mask that hides f of it   V | T ~ Binomial(T, 1 − f), H = T − V
    so                          P(k | V) ∝ π_k Π_c NB(V_c; (1 − f) m_kc, r_kc)^τ
                                H | V, k ~ NB(f (r + V) / (r / m + 1 − f), r + V)

    its label l, if told        multiplies P(k | V) by P(k | l) / P(k)

π, m and r are fitted to the training rooms by expectation maximisation, P(k | l) by what the
labelled rooms turn out to be. τ < 1 (`temper`) because
the classes of a room are not independent given its type; the plain product is too confident.

With `kinds = "named"` the types are the room labels. Then π is of the table that was written by
hand (`bsg_models.zoo.hand_prior`), m and r are of the table and of the training rooms with the
label, a label is right with probability `_TRUST`, and α is `_NAMED_HABIT`: few buildings do not
tell it.

The building is a second level (`building`). Its habits are estimated from the *other* rooms that
were looked into:

    its types                   π_b ∝ η π + Σ P(k | V) over the other rooms
    its rate of class c         g_bc = (α_c + Σ V_c) / (α_c + Σ E V_c), the mean of a
                                Gamma(α_c, α_c) given the other rooms; it multiplies m_kc

Then every room is predicted again with π_b and g_b m.

With `tilted` J > 0 the prior of the first J counts of every type is tilted
(`bsg_models.belief.negative_binomial`), so that a type can have exactly one of a class. m is then
the mean before tilts; E V is that of the tilted counts. In a room that nobody looked into, f is 1
and V is no evidence: the prediction follows from the building's types and habits. For a withheld
class, f is that of the class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np
import numpy.typing as npt
from pydantic import Field

from bsg_data.arrays import Bools, Floats, Ints, find_runs
from bsg_data.observation.observation import Observation
from bsg_data.scene.room_label import list_room_labels
from bsg_data.scene.surroundings import BUILDING_KINDS, UNKNOWN
from bsg_models.belief.count_distribution import CountDistribution
from bsg_models.belief.negative_binomial import (
    TINY,
    hidden_posterior,
    hidden_tilts,
    log_negative_binomial,
    log_seen,
    none_seen,
    tilt_gains,
)
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.special_functions import log_sum_exp
from bsg_models.zoo.calibration import CalibratedModel
from bsg_models.zoo.catalogue import ZooRow
from bsg_models.zoo.hand_prior import read_hand_prior
from bsg_models.zoo.model import ModelInputs
from bsg_models.zoo.room_types import (
    MISSING,
    MOST,
    FittedTypes,
    Rooms,
    fit_named_types,
    fit_types,
    tilted_means,
)
from bsg_models.zoo.settings import DataConfig, ModelConfig

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset

_PRIOR_TYPES = 8.0  # η: weight of the average building in π_b, in rooms
_PRIOR_LABEL = 4.0  # weight of the average room in P(k | l), in rooms
# Of types that have names.
_TRUST = 0.95  # P(a label is right); else it says nothing
_NAMED_HABIT = 4.0  # α of every class


class _MixtureConfig(ModelConfig):
    """Latent room types with negative-binomial counts, fitted by expectation maximisation."""

    family: Literal["mixture"] = "mixture"
    kinds: Literal["latent", "named"] = "latent"  # of rooms: found, or those of a table by hand
    types: int = Field(default=16, ge=1, le=1000)  # if they are latent
    iterations: int = Field(default=60, ge=1, le=10_000)
    temper: float = Field(default=0.85, gt=0, le=1)  # τ
    building: bool = True  # whether the other rooms of a building inform
    tilted: int = Field(default=2, ge=0, le=8)  # J
    calibrate: bool = True  # on the val buildings

    @property
    def number(self) -> int:
        """Number of types, K."""
        return self.types if self.kinds == "latent" else len(list_room_labels())


class _RoomTypeMixture(CalibratedModel):
    """Room types, fitted by counting; the posterior is in closed form."""

    log_types: Floats  # [K] log π
    means: Floats  # [K, C] m
    dispersions: Floats  # [K, C] r
    habits: Floats  # [C] α; large if buildings do not differ
    labels: Floats  # [K, L] log P(k | label) / P(k)
    tilts: Floats  # [J, K, C] log factors of the first counts; only with `tilted`

    config: _MixtureConfig
    reads_labels = True

    def __init__(self, config: _MixtureConfig, inputs: ModelInputs) -> None:
        super().__init__(config, inputs)
        ones = np.ones((config.number, inputs.classes))
        self.hold(log_types=0 * ones[:, 0], means=ones, dispersions=ones, habits=ones[0])
        self.hold(labels=np.zeros((config.number, len(list_room_labels()))))
        if config.tilted:
            self.hold(tilts=np.zeros((config.tilted, *ones.shape)))

    def fit(self, data: Dataset, choice: DataConfig) -> None:
        """Fit types, and how much buildings differ, to the rooms of the training buildings."""
        scenes = scenes_of(data, "train", fold=choice.fold)
        counts, building = read_rooms(data, scenes, limit=MOST)
        labels = read_labels(data, scenes)
        if self.config.kinds == "named":
            at_home = _list_homes(data, scenes)[building]
            fitted = fit_named_types(
                counts,
                choose_labels(labels, at_home),
                read_hand_prior(data.manifest.class_space.classes),
                tilted=self.config.tilted,
            )
            odds = _trust_labels(fitted.log_types)
            habits = np.full(counts.shape[1], _NAMED_HABIT)
        else:
            fitted = self._find_types(counts)
            odds = fit_labels(fitted.weigh(counts)[0], labels)
            habits = _fit_habits(counts, building, fitted)
        self.hold(
            log_types=fitted.log_types,
            means=fitted.means,
            dispersions=fitted.dispersions,
            habits=habits,
            labels=odds,
        )
        if self.config.tilted:
            self.hold(tilts=fitted.tilts)

    def _find_types(self, counts: Rooms) -> FittedTypes:
        """Return latent types of rooms `[R, C]`."""
        import torch  # was seeded with the run's seed; only trainings come here

        if len(counts) < self.config.types:
            raise TrainingError(
                f"{len(counts)} training rooms are too few for {self.config.types} room types; "
                "lower model.types"
            )
        return fit_types(
            counts,
            types=self.config.types,
            iterations=self.config.iterations,
            seed=int(torch.randint(2**31, (1,)).item()),
            tilted=self.config.tilted,
        )

    def predict_hidden_counts(self, seen: Observation) -> CountDistribution:
        """Return the posterior of the hidden counts of every room, K components."""
        return self.learned_rooms(seen, np.arange(len(seen.inputs)))

    def learned_rooms(self, seen: Observation, rows: Ints) -> CountDistribution:
        """Return the uncalibrated hidden counts of some rooms; all that they show says the type."""
        rooms = _Rooms(
            seen=seen.inputs.astype(np.float64),
            share=seen.cell_share,
            looked_into=seen.looked_into & ~seen.is_building,
            type_odds=self._read_labels(seen.surroundings.labels),
        )
        own, types, means = rooms.take(rows), self.log_types[:, None], self.means[:, None]
        if self.config.building:
            alone, every = rooms.find_distinct() if len(seen) > 1 else (rooms, slice(None))
            posterior = self._weigh(alone, types, means)[:, every]
            types, habit = self._learn_habits(rooms, seen.building, posterior)
            types, means = types[:, rows], means * habit[rows]
        weights = self._weigh(own, types, means)[:, :, None]
        r = self.dispersions[:, None]
        hidden, dispersions = hidden_posterior(r, r / means, own.seen, own.share)
        tilts = None
        if self.config.tilted:
            tilts = np.stack(hidden_tilts(self.tilts[:, :, None], own.seen))
        return CountDistribution(hidden, np.broadcast_to(dispersions, hidden.shape), weights, tilts)

    def _read_labels(self, labels: npt.NDArray[np.float32]) -> Floats:
        """Return what P(label) `[N, L]` says of each type, `[N, K]`; nothing if it is unknown."""
        odds = labels @ np.exp(self.labels.T)
        return np.log(odds, where=odds > 0, out=np.zeros_like(odds))

    def _weigh(self, rooms: _Rooms, log_types: Floats, means: Floats) -> Floats:
        """Return P(type | seen) `[K, rooms]`, from the prior of types and their means."""
        log_posterior = log_types + rooms.type_odds.T
        log_posterior += self.config.temper * self._log_seen(rooms, means) * rooms.looked_into
        log_posterior -= log_sum_exp(log_posterior, axis=0)
        return np.exp(log_posterior)

    def _log_seen(self, rooms: _Rooms, means: Floats) -> Floats:
        """Return log P(seen counts) under every type, `[K, rooms]`."""
        r, tilts = self.dispersions[:, None], self._tilts
        gains = () if tilts is None else tilt_gains(tilts[:, :, None], means, r)
        none = none_seen(rooms.share, means, r, gains)
        row, column = np.nonzero(rooms.seen)
        none[:, row, column] = 1.0
        log_p = np.asarray(np.log(np.maximum(none, TINY)).sum(axis=2))
        starts, some = find_runs(row)
        if len(some):
            each = log_seen(
                rooms.seen[row, column],
                rooms.share[row, column],
                means[:, row * (means.shape[1] > 1), column],
                self.dispersions[:, column],
                None if tilts is None else tilts[:, :, column],
            )
            log_p[:, some] += np.add.reduceat(each, starts, axis=1)
        return log_p

    @property
    def _tilts(self) -> Floats | None:
        return self.tilts if self.config.tilted else None

    def _learn_habits(
        self, rooms: _Rooms, building: Ints, posterior: Floats
    ) -> tuple[Floats, Floats]:
        """Return log π_b `[K, rooms]` and g_b `[rooms, C]`, from the other rooms."""
        looked_into = rooms.looked_into[:, None].astype(float)
        belonging = posterior.T * looked_into
        usual = tilted_means(self.means, self.dispersions, self._tilts)
        types, found, expected = (
            _sum_others(values, building)
            for values in (
                belonging,
                rooms.seen * looked_into,
                (1 - rooms.share) * (belonging @ usual),
            )
        )
        types += _PRIOR_TYPES * np.exp(self.log_types)
        habit = self.habits
        gain = (habit + found) / (habit + expected)
        return np.log(types / types.sum(axis=1, keepdims=True)).T, gain


@dataclass(frozen=True, eq=False)
class _Rooms:
    """What N nodes show; a building itself says nothing of its rooms, as if nobody looked."""

    seen: Floats  # [N, C]
    share: Floats  # [N, C] that is hidden
    looked_into: Bools  # [N]
    type_odds: Floats  # [N, K] what its label says of its type

    def take(self, rows: Ints) -> _Rooms:
        """Return some of the nodes."""
        return _Rooms(
            self.seen[rows], self.share[rows], self.looked_into[rows], self.type_odds[rows]
        )

    def find_distinct(self) -> tuple[_Rooms, Ints]:
        """Return the nodes that differ, and which of them each is: a search repeats many."""
        shown = np.column_stack([self.seen, self.share, self.looked_into, self.type_odds])
        number: dict[bytes, int] = {}
        every = np.array([number.setdefault(row.tobytes(), len(number)) for row in shown])
        return self.take(np.unique(every, return_index=True)[1]), every


def read_rooms(
    data: Dataset, scenes: Sequence[str], *, limit: int
) -> tuple[npt.NDArray[np.uint8], Ints]:
    """Return the counts of some rooms `[R, C]`, cut to `limit`, and each room's building `[R]`.

    A class that the source has no word for counts as `limit` + 1.
    """
    rooms: dict[str, npt.NDArray[np.uint8]] = {}
    for some in data.in_shards(scenes):
        for scene in some:
            counts = np.minimum(data.cells(scene)[1:], limit)
            rooms[scene] = np.where(data.nameable(scene), counts, limit + 1).astype(np.uint8)
    sizes = [len(rooms[scene]) for scene in scenes]
    joined = np.concatenate([rooms[scene] for scene in scenes])
    return joined, np.repeat(np.arange(len(scenes)), sizes)


def read_labels(data: Dataset, scenes: Sequence[str]) -> Floats:
    """Return P(label) of the rooms of `read_rooms`, `[R, L]`."""
    own = {
        scene: data.surroundings(scene).labels for some in data.in_shards(scenes) for scene in some
    }
    return np.concatenate([own[scene][1:] for scene in scenes]).astype(np.float64)


def choose_labels(labels: Floats, at_home: Bools) -> Floats:
    """Return the labels `[R, L]` from which a kind of room is learned, 0 for other rooms.

    A kind that homes have is learned in homes alone: the corridor of a school is another.
    """
    labelled = labels > 0
    return np.where(at_home[:, None] | ~labelled[at_home].any(axis=0), labels, 0.0)


def _list_homes(data: Dataset, scenes: Sequence[str]) -> Bools:
    """Return which buildings are homes `[B]`; one of unknown kind counts as a home."""
    home = (UNKNOWN, BUILDING_KINDS.index("home"))
    return np.array([data.surroundings(scene).building_kinds[0] in home for scene in scenes])


def _trust_labels(log_types: Floats) -> Floats:
    """Return log P(type | label) / P(type) `[K, K]` of types that are the labels."""
    types = np.exp(log_types)[:, None]
    return np.asarray(np.log(_TRUST * np.eye(len(types)) / types + 1 - _TRUST))


def fit_labels(belonging: Floats, labels: Floats) -> Floats:
    """Return log P(type | label) / P(type) `[K, L]`, of the labelled among the rooms.

    A label that few rooms have says little: it is shrunk towards the labelled rooms on the whole.
    """
    labelled = labels.sum(axis=1) > 0
    number = belonging[labelled].T @ labels[labelled]
    types = (number.sum(axis=1) + 1) / (number.sum() + len(number))
    share = (number + _PRIOR_LABEL * types[:, None]) / (number.sum(axis=0) + _PRIOR_LABEL)
    return np.asarray(np.log(share) - np.log(types)[:, None])


def _fit_habits(counts: Rooms, building: Ints, fitted: FittedTypes) -> Floats:
    """Return α `[C]`: how similar buildings are, given the types of their rooms `[R, C]`."""
    buildings, building = np.unique(building, return_inverse=True)
    totals = np.zeros((len(buildings), counts.shape[1]))
    rooms = np.zeros((len(totals), len(fitted.means)))  # of every type
    known = np.ones(totals.shape, dtype=bool)
    known[building] = counts != MISSING
    np.add.at(totals, building, np.where(known[building], counts, 0))
    np.add.at(rooms, building, fitted.weigh(counts)[0])
    expected = rooms @ fitted.expected
    columns = zip(totals.T, expected.T, known.T, strict=True)
    return np.array([fit_habit(t[own], e[own]) for t, e, own in columns])


def fit_habit(totals: Floats, expected: Floats) -> float:
    """Return α of one class: a building's count is NB(expected, dispersion α); both `[B]`."""

    def cost(log_shape: float) -> float:
        shape = float(np.exp(log_shape))
        return -float(log_negative_binomial(totals, np.maximum(expected, 1e-9), shape).sum())

    from scipy.optimize import minimize_scalar

    minimum = minimize_scalar(cost, bounds=(-3.0, 8.0), method="bounded")
    return float(np.exp(minimum.x))


def _sum_others(values: Floats, building: Ints) -> Floats:
    """Return the sum over the other rooms of each room's building, `[rooms, ...]`."""
    sums = np.zeros((int(building.max(initial=-1)) + 1, values.shape[1]))
    np.add.at(sums, building, values)
    return np.asarray(np.maximum(sums[building] - values, 0.0))


MIXTURE = ZooRow(_MixtureConfig(), _RoomTypeMixture)
