"""Measure whether beliefs about the remaining rooms improve while a robot searches the others.

A robot starts with nothing seen, or with half of every room seen, and searches the rooms of a
building in random orders. The gain is the decrease of −log P (in nats) of everything that an
unsearched room hides, after a quarter, a half and three quarters of the rooms were searched.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Literal

import numpy as np
from building_means import BuildingMeans, join_buildings
from fold_models import FoldModel

from bsg_data.arrays import Bools, Counts
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked
from bsg_data.observation.observation import Observation, stack
from bsg_data.observation.view import share_of_building
from bsg_data.recipes import MaskRecipe
from bsg_models.evaluation.metrics import Floats
from bsg_models.zoo.threads import one_thread

Start = Literal["nothing", "half"]
STARTS: dict[Start, MaskRecipe] = {
    "nothing": MaskRecipe(strategy="rooms", fraction=1.0),
    "half": MaskRecipe(strategy="uniform", fraction=0.5),
}
ALL = MaskRecipe(strategy="uniform", fraction=0.0)  # hides nothing
STOPS = {"a quarter": 1, "a half": 2, "three quarters": 3}
ORDERS = 6
LEAST_ROOMS = 4


def search_rooms(seen: Observation, all_: Observation, rooms: Bools) -> Observation:
    """Return the observation of one building after some of its rooms were searched.

    Args:
        seen: of the building before.
        all_: of the building when nothing is hidden.
        rooms: `[N]` that are searched; never the building (0).
    """
    share = np.where(rooms, 0.0, seen.hidden_share.astype(float))
    share[0] = share_of_building(share)
    withheld = seen.withheld & ~rooms[:, None]
    withheld[0] &= share[0] > 0
    return replace(
        seen,
        inputs=_show(seen.inputs, all_.inputs, rooms),
        others=_show(seen.others, all_.others, rooms),
        hidden_share=share.astype(np.float32),
        visited=seen.visited | rooms,
        withheld=withheld,
    )


def measure_searched(
    one: FoldModel, *, start: Start = "nothing", orders: int = ORDERS
) -> BuildingMeans:
    """Return the gains after each of the `STOPS`, a mean over buildings; nats per room.

    Args:
        one: a model and its test buildings; only those of four rooms or more are used.
        start: what the robot has seen before: `nothing`, or `half` of every room.
        orders: number of random orders in which the rooms of a building are searched.
    """
    vocabulary = one.model.vocabulary
    before, after = (
        sample_masked(one.data, one.scenes, mask=mask, draw=0, vocabulary=vocabulary)
        for mask in (STARTS[start], ALL)
    )
    scenes, gains = [], []
    with one_thread():
        for number, scene in enumerate(one.scenes):
            begun, all_ = before.take([number]), after.take([number]).seen
            if len(begun.targets) > LEAST_ROOMS:
                scenes.append(scene)
                gains.append(_gain(one, begun, all_, orders))
    columns = np.array(gains).reshape(-1, len(STOPS)).T
    once = np.ones(len(scenes))
    return BuildingMeans(
        tuple(scenes), dict(zip(STOPS, columns, strict=True)), dict.fromkeys(STOPS, once)
    )


def measure_searched_folds(
    models: Iterable[FoldModel], *, start: Start = "nothing", orders: int = ORDERS
) -> BuildingMeans:
    """Return the gains of the models of all folds, as a mean over all buildings."""
    return join_buildings([measure_searched(one, start=start, orders=orders) for one in models])


def _gain(one: FoldModel, begun: MaskedBuildings, all_: Observation, orders: int) -> Floats:
    """Return the gain after each stop, `[3]`, a mean over the orders."""
    rooms = len(begun.targets) - 1
    rng = np.random.default_rng(0)
    marks = []
    for _ in range(orders):
        order = 1 + rng.permutation(rooms)
        for quarter in STOPS.values():
            searched = np.zeros(rooms + 1, dtype=bool)
            searched[order[: max(1, rooms * quarter // 4)]] = True
            marks.append(searched)
    moments = stack([begun.seen, *(search_rooms(begun.seen, all_, mark) for mark in marks)])
    hidden = np.tile(begun.targets, (len(moments), 1)) - moments.inputs
    expected = one.model.expect(moments)
    surprise = -expected.log_probability(hidden.astype(float)).sum(axis=1)
    surprise = surprise.reshape(len(moments), rooms + 1)
    gains = [
        (surprise[0] - late)[1:][~mark[1:]].mean()
        for late, mark in zip(surprise[1:], marks, strict=True)
    ]
    return np.asarray(np.reshape(gains, (orders, len(STOPS))).mean(axis=0))


def _show(seen: Counts, all_: Counts, rooms: Bools) -> Counts:
    """Return histograms in which some rooms show everything, with the building's sum updated."""
    shown = np.where(rooms[:, None], all_, seen)
    shown[0] = seen[0] + (shown - seen)[1:].sum(axis=0)
    return shown
