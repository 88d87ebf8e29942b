"""What planners save: the statistics of a search study.

A saving is 1 − Σ cost / Σ cost of `nearest` over the same searches. Its interval is a bootstrap
over buildings. The mean and the median over single searches are given besides, because they
differ: the mean is ruled by the searches in which `nearest` was lucky.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bsg_models.search.planners import PLANNERS, Task
from bsg_models.search.shortest_paths import Floats
from bsg_models.search.simulator import Outcome
from bsg_models.studies.search_cases import BASELINE, ROUTING
from bsg_models.studies.search_study import Searches, Study

LEAST_BUILDINGS = 5  # of fewer, a bootstrap says nothing
_TIE = 1e-9  # costs that differ by less than this share are a tie


@dataclass(frozen=True, slots=True)
class Interval:
    """A value and its 95 % interval; NaN where it has none."""

    value: float
    low: float
    high: float


@dataclass(frozen=True, slots=True)
class Saving:
    """How one planner did in one world and task, beside `nearest` in the same searches.

    Attributes:
        saved: 1 − ratio of the total costs.
        beyond_routing: by how much more than `routing`, which has no belief: the merit of the
            belief; NaN for a planner without one, or without `routing`.
        of_oracle: share of what `oracle` saves; NaN without it.
        mean: over the searches of 1 − ratio of the costs.
        median: of the same.
        wins: searches that cost less than with `nearest`.
        ties: that cost the same.
        losses: that cost more.
        cost: mean of a search.
        entered: rooms, mean of a search.
    """

    saved: Interval
    beyond_routing: Interval
    of_oracle: Interval
    mean: float
    median: float
    wins: int
    ties: int
    losses: int
    cost: float
    entered: float


@dataclass(frozen=True, slots=True)
class Stop:
    """A robot that ends its search itself, beside entering every room, nearest first.

    Attributes:
        saved: 1 − ratio of the total costs.
        missed: share of all instances that were not found.
        incomplete: share of the searches that missed one at least.
        entered: rooms, mean of a search.
    """

    saved: Interval
    missed: Interval
    incomplete: Interval
    entered: float


@dataclass(frozen=True, eq=False)
class WorldResult:
    """All planners in one world and task.

    Attributes:
        world: its name.
        task: when a search ends.
        buildings: that were searched.
        searches: in all.
        ranked_first: share of the searches at whose start the likeliest room holds an artifact.
        chance: the same of a room drawn at random.
        savings: planner → saving, in the order of the study.
        stops: threshold → how a robot did that stops itself.
    """

    world: str
    task: Task
    buildings: int
    searches: int
    ranked_first: float
    chance: float
    savings: dict[str, Saving]
    stops: dict[str, Stop]


def summarise(study: Study, *, resamples: int = 1000) -> list[WorldResult]:
    """Return the results of every world and task of a study.

    Args:
        study: of `study_search`.
        resamples: of the bootstrap; below 2 for no intervals, as where buildings are few.
    """
    found = []
    for world in dict.fromkeys(one.world for one in study.searches):
        searches = [one for one in study.searches if one.world == world]
        rng = np.random.Generator(np.random.PCG64(study.recipe.seed))
        size = max(resamples, 0) if len(searches) >= LEAST_BUILDINGS else 0
        times = rng.multinomial(len(searches), np.full(len(searches), 1 / len(searches)), size=size)
        weights = np.vstack([np.ones(len(searches)), times])
        found += [_stand(searches, task, weights) for task in study.recipe.tasks]
    return found


def _stand(searches: Sequence[Searches], task: Task, weights: Floats) -> WorldResult:
    names = [name for of_task, name in searches[0].outcomes if of_task == task]
    planners = [name for name in names if name != "sweep" and not name.startswith("stop ")]
    saved = {name: _saved(searches, task, name, BASELINE, weights) for name in planners}
    costs = {
        name: np.concatenate([one.outcomes[task, name].costs for one in searches])
        for name in planners
    }
    base = costs[BASELINE]
    savings, unknown = {}, np.array([np.nan])
    for name in planners:
        each = 1 - np.divide(costs[name], base, out=np.ones_like(base), where=base > 0)
        off = costs[name] - base
        has_belief = PLANNERS[name].reads == "belief"
        routed = saved[ROUTING] if has_belief and ROUTING in saved else unknown
        savings[name] = Saving(
            saved=interval(saved[name]),
            beyond_routing=interval(saved[name] - routed),
            of_oracle=interval(_divide(saved[name], saved.get("oracle", unknown))),
            mean=float(each.mean()),
            median=float(np.median(each)),
            wins=int((off < -_TIE * base).sum()),
            ties=int((np.abs(off) <= _TIE * base).sum()),
            losses=int((off > _TIE * base).sum()),
            cost=float(costs[name].mean()),
            entered=_mean_entered(searches, task, name),
        )
    return WorldResult(
        world=searches[0].world,
        task=task,
        buildings=len(searches),
        searches=len(base),
        ranked_first=float(np.concatenate([one.ranked_first for one in searches]).mean()),
        chance=float(np.concatenate([one.chance for one in searches]).mean()),
        savings=savings,
        stops={
            name.removeprefix("stop "): _stop(searches, name, weights)
            for name in names
            if name.startswith("stop ")
        },
    )


def saving_of_buildings(searches: Sequence[Searches], task: Task, name: str) -> Floats:
    """Return what a planner saves in each building, `[B]`."""
    sums = [
        [one.outcomes[task, which].costs.sum() for which in (name, BASELINE)] for one in searches
    ]
    ours, base = np.array(sums).T
    return np.asarray(1 - np.divide(ours, base, out=np.ones_like(base), where=base > 0))


def _saved(
    searches: Sequence[Searches], task: Task, name: str, baseline: str, weights: Floats
) -> Floats:
    """Return the saving in all buildings, then in each resample of them, `[1 + resamples]`."""
    ours, base = (
        weights @ np.array([one.outcomes[task, which].costs.sum() for one in searches])
        for which in (name, baseline)
    )
    return np.asarray(1 - _divide(ours, base))


def _stop(searches: Sequence[Searches], name: str, weights: Floats) -> Stop:
    outcomes: list[Outcome] = [one.outcomes["all", name] for one in searches]
    instances = weights @ np.array([one.instances.sum() for one in searches])
    missed = weights @ np.array([outcome.missed.sum() for outcome in outcomes])
    incomplete = weights @ np.array([(outcome.missed > 0).sum() for outcome in outcomes])
    number = weights @ np.array([len(outcome.costs) for outcome in outcomes])
    return Stop(
        saved=interval(_saved(searches, "all", name, "sweep", weights)),
        missed=interval(_divide(missed, instances)),
        incomplete=interval(_divide(incomplete, number)),
        entered=_mean_entered(searches, "all", name),
    )


def _mean_entered(searches: Sequence[Searches], task: Task, name: str) -> float:
    return float(np.concatenate([one.outcomes[task, name].entered for one in searches]).mean())


def _divide(a: Floats, b: Floats) -> Floats:
    a, b = np.broadcast_arrays(a, b)
    return np.asarray(np.divide(a, b, out=np.full(a.shape, np.nan), where=b != 0))


def interval(values: Floats) -> Interval:
    """Return the first value with the interval of the others."""
    if len(values) < 3 or np.isnan(values[1:]).all():
        return Interval(float(values[0]), float("nan"), float("nan"))
    low, high = np.nanpercentile(values[1:], [2.5, 97.5])
    return Interval(float(values[0]), float(low), float(high))
