"""Measure what a model believes of rooms that were half seen, glimpsed, or not visited.

A mean over all rooms hides a difference that matters to a robot: a model may be good in half-seen
rooms and no better than a prior in unseen ones. So rooms are measured in three views:

- `half-seen`: the robot was there, and a part is hidden, 0 < hidden share < 1;
- `glimpsed`: it was not there, and saw a little through the door, 0 < hidden share < 1;
- `unvisited`: nothing was seen, hidden share 1.

Searched rooms hide nothing, and are in no view.

Sums are kept per building. So batches and folds can be added up, and a bootstrap over buildings
divides once. Likelihoods and shares may be pooled over folds; rankings may not.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np

from bsg_data.arrays import Floats, Ints
from bsg_data.observation.masked_buildings import MaskedBuildings
from bsg_data.observation.observation import Observation
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.bootstrap import Estimate, bootstrap

VIEWS = ("half-seen", "glimpsed", "unvisited")
VALUES = ("nll", "presence", "present", "presence_log_loss")


@dataclass(frozen=True, eq=False)
class RoomViews:
    """Sums over the rooms of B buildings in each of V views, for C classes.

    Attributes:
        scene_ids: `[B]`, in order.
        rooms: `[B, V]` number of rooms; each draw counts.
        nll: `[B, V, C]` Σ −log P(hidden counts), as in the metric `hidden_nll`.
        presence: `[B, V, C]` Σ predicted P(at least one hidden object).
        present: `[B, V, C]` number of rooms with a hidden object.
        presence_log_loss: `[B, V, C]` Σ −log P(whether there is a hidden object).
    """

    scene_ids: tuple[str, ...]
    rooms: Floats
    nll: Floats
    presence: Floats
    present: Floats
    presence_log_loss: Floats

    def evaluate(self, building_weights: Floats | None = None) -> dict[str, float]:
        """Return the mean of each value over the (room, class) cells of a view.

        Names are `half-seen/nll`, and `half-seen/presence_log_loss/7` for class 7 only. A view
        without rooms has nan.

        Args:
            building_weights: `[B]` how often each building counts; None counts each once.
        """
        found = {}
        for value in VALUES:
            means = self.average(value, building_weights)
            for view, of_classes in zip(VIEWS, means, strict=True):
                found[f"{view}/{value}"] = float(of_classes.mean())
                if value == "presence_log_loss":
                    each = enumerate(of_classes.tolist())
                    found |= {f"{view}/{value}/{number}": mean for number, mean in each}
        return found

    def average(self, value: str, building_weights: Floats | None = None) -> Floats:
        """Return the mean of one of `VALUES` over rooms, `[V, C]`; nan in a view without rooms.

        Args:
            value: its name.
            building_weights: `[B]` how often each building counts; None counts each once.
        """
        if value not in VALUES:
            raise ValueError(f"no value {value!r} of room views; known are {', '.join(VALUES)}")
        weights = np.ones(len(self.scene_ids)) if building_weights is None else building_weights
        sums: Floats = np.tensordot(weights, getattr(self, value), axes=1)
        number = (weights @ self.rooms)[:, None]
        unknown = np.full_like(sums, np.nan)
        return np.divide(sums, number, out=unknown, where=number > 0)

    def count_nodes(self, metric: str) -> int:
        """Return the number of rooms behind a value of `evaluate`."""
        return int(self.rooms[:, VIEWS.index(metric.partition("/")[0])].sum())


def view_of(seen: Observation) -> Ints:
    """Return the index in `VIEWS` of each node's view, `[N]`; -1 for none."""
    share, partly = seen.hidden_share, (seen.hidden_share > 0) & (seen.hidden_share < 1)
    kinds = [partly & seen.visited, partly & ~seen.visited, share == 1]
    return np.where(seen.is_building, -1, np.select(kinds, range(len(VIEWS)), default=-1))


def measure_room_views(expectation: Expectation, masked: MaskedBuildings) -> RoomViews:
    """Sum what a model believes of the rooms of masked buildings.

    Args:
        expectation: of the N nodes, in their order.
        masked: buildings with their targets; a building may occur under several masks.

    Raises:
        ValueError: if the expectation has other nodes.
    """
    seen = masked.seen
    if expectation.inputs.shape != seen.inputs.shape:
        raise ValueError(
            f"the expectation has {expectation.inputs.shape} nodes and classes, the masked "
            f"buildings have {seen.inputs.shape}"
        )
    hidden = masked.hidden.astype(float)
    absent = expectation.log_probability(np.zeros_like(hidden))  # log P(none)
    with np.errstate(divide="ignore"):  # log 0 occurs only in the branch not taken
        log_presence = np.log(-np.expm1(absent))
    values = {
        "nll": -expectation.log_probability(hidden),
        "presence": expectation.presence,
        "present": (hidden > 0).astype(float),
        "presence_log_loss": -np.where(hidden > 0, log_presence, absent),
    }
    scenes = sorted(set(seen.scene_ids))
    number = {scene: place for place, scene in enumerate(scenes)}
    building = np.array([number[scene] for scene in seen.scene_ids])[seen.building]
    view = view_of(seen)
    rows = np.flatnonzero(view >= 0)
    cell = building[rows] * len(VIEWS) + view[rows]
    shape = (len(scenes), len(VIEWS))

    def add(of_rooms: Floats) -> Floats:
        sums = np.zeros((len(scenes) * len(VIEWS), *of_rooms.shape[1:]))
        np.add.at(sums, cell, of_rooms)
        return sums.reshape(*shape, *of_rooms.shape[1:])

    return RoomViews(
        tuple(scenes),
        add(np.ones(len(rows))),
        **{name: add(of_nodes[rows]) for name, of_nodes in values.items()},
    )


def add_room_views(parts: Iterable[RoomViews]) -> RoomViews:
    """Return the sums of several batches or folds as one; a building may occur in several.

    Raises:
        ValueError: if there are none.
    """
    parts = tuple(parts)
    if not parts:
        raise ValueError("room views: expected one batch or more to add up, found none")
    scenes = sorted({scene for part in parts for scene in part.scene_ids})
    number = {scene: place for place, scene in enumerate(scenes)}
    places = np.array([number[scene] for part in parts for scene in part.scene_ids], dtype=int)

    def add(name: str) -> Floats:
        every = np.concatenate([getattr(part, name) for part in parts])
        sums = np.zeros((len(scenes), *every.shape[1:]))
        np.add.at(sums, places, every)
        return sums

    return RoomViews(tuple(scenes), add("rooms"), **{name: add(name) for name in VALUES})


def compare_room_views(
    ours: RoomViews, theirs: RoomViews, *, resamples: int = 200, seed: int = 0
) -> dict[str, Estimate]:
    """Return `evaluate` of one model minus another's, with intervals over buildings.

    The comparison is paired: both use the same rooms, and the same resamples of the buildings.

    Args:
        ours: of the first model.
        theirs: of the second model, on the same masks of the same buildings.
        resamples: of the bootstrap; fewer than 2 give no intervals.
        seed: of the resamples.

    Raises:
        ValueError: if they were measured on other rooms.
    """
    same = ours.scene_ids == theirs.scene_ids and np.array_equal(ours.rooms, theirs.rooms)
    if not (same and np.array_equal(ours.present, theirs.present)):
        raise ValueError("the two models were measured on other rooms or under other masks")
    one, other = (bootstrap(some, resamples=resamples, seed=seed) for some in (ours, theirs))
    return {name: one.difference(other, name) for name in one.point}
