"""Compute what planners save, the statistics of a search study, and write its searches.

A saving is 1 − Σ cost / Σ cost of `nearest` over the same searches, with a bootstrap interval over
buildings. Mean and median over single searches differ from it, because a few searches in which
`nearest` was lucky dominate the mean.
"""

from __future__ import annotations

import io
from collections.abc import Collection, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.arrays import Floats
from bsg_data.files import write_bytes
from bsg_models.evaluation.bootstrap import (
    LEAST_BUILDINGS,
    Estimate,
    estimate_value,
    resample_buildings,
)
from bsg_models.search.knowledge import Task
from bsg_models.search.simulator import Outcome
from bsg_models.studies.search_cases import BASELINE, ROUTING
from bsg_models.studies.search_study import Searches, Study

_TIE = 1e-9  # relative difference below which two costs are a tie


@dataclass(frozen=True, slots=True)
class Saving:
    """The result of one planner in one world and task, compared with `nearest`."""

    saved: Estimate  # 1 − ratio of the total costs
    # `saved` minus that of `routing`, which uses no belief; NaN without `routing`, or for a planner
    # that reads no belief
    beyond_routing: Estimate
    of_oracle: Estimate  # share of what `oracle` saves; NaN without it
    mean: float  # of 1 − ratio of the costs, over the searches
    median: float  # of the same
    wins: int  # searches that cost less than with `nearest`
    ties: int  # searches that cost the same
    losses: int  # searches that cost more
    cost: float  # mean over the searches
    entered: float  # rooms, mean over the searches


@dataclass(frozen=True, slots=True)
class Stop:
    """How a robot that stops by itself compares with entering every room, nearest first."""

    saved: Estimate  # 1 − ratio of the total costs
    missed: Estimate  # share of all instances that were not found
    incomplete: Estimate  # share of the searches that missed at least one
    entered: float  # rooms, mean over the searches


@dataclass(frozen=True, eq=False)
class WorldResult:
    """All planners in one world and task."""

    world: str  # its name
    task: Task  # when a search ends
    buildings: int  # number searched
    searches: int  # in all
    ranked_first: float  # share of the searches whose likeliest room at the start holds an artifact
    chance: float  # the same for a room drawn at random
    savings: dict[str, Saving]  # planner → saving, in the order of the study
    stops: dict[str, Stop]  # threshold → result of the robot that stops by itself


def summarise(study: Study, *, resamples: int = 1000) -> list[WorldResult]:
    """Return the results of every world and task; too few resamples or buildings: no intervals."""
    results = []
    for world in dict.fromkeys(one.world for one in study.searches):
        searches = [one for one in study.searches if one.world == world]
        size = resamples if len(searches) >= LEAST_BUILDINGS else 0
        times = resample_buildings(len(searches), resamples=size, seed=study.recipe.seed)
        weights = np.vstack([np.ones(len(searches)), times])
        believing = {name for name, one in study.planners.items() if one.reads == "belief"}
        results += [
            _summarise_task(searches, task, weights, believing) for task in study.recipe.tasks
        ]
    return results


def _summarise_task(
    searches: Sequence[Searches], task: Task, weights: Floats, believing: Collection[str]
) -> WorldResult:
    """Return the results of one world and task, under weights `[1 + resamples, B]`.

    The first row of the weights counts each building once. `believing` planners read a belief.
    """
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
        routed = saved[ROUTING] if name in believing and ROUTING in saved else unknown
        savings[name] = Saving(
            saved=_estimate(saved[name], len(base)),
            beyond_routing=_estimate(saved[name] - routed, len(base)),
            of_oracle=_estimate(_divide(saved[name], saved.get("oracle", unknown)), len(base)),
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
    every = sum(len(outcome.costs) for outcome in outcomes)
    return Stop(
        saved=_estimate(_saved(searches, "all", name, "sweep", weights), every),
        missed=_estimate(_divide(missed, instances), every),
        incomplete=_estimate(_divide(incomplete, number), every),
        entered=_mean_entered(searches, "all", name),
    )


def _mean_entered(searches: Sequence[Searches], task: Task, name: str) -> float:
    return float(np.concatenate([one.outcomes[task, name].entered for one in searches]).mean())


def _divide(a: Floats, b: Floats) -> Floats:
    a, b = np.broadcast_arrays(a, b)
    return np.asarray(np.divide(a, b, out=np.full(a.shape, np.nan), where=b != 0))


def _estimate(values: Floats, searches: int) -> Estimate:
    """Return the first value, with the interval of the others."""
    return estimate_value(float(values[0]), values[1:], nodes=searches, rule="percentile")


_SEARCHES = pa.schema(
    [
        pa.field("scene_id", pa.string(), nullable=False),
        pa.field("world", pa.string(), nullable=False),
        pa.field("task", pa.string(), nullable=False),
        pa.field("planner", pa.string(), nullable=False),
        pa.field("episode", pa.int32(), nullable=False),
        pa.field("artifacts", pa.list_(pa.string()), nullable=False),
        pa.field("start_room_index", pa.int32(), nullable=False),
        pa.field("draw", pa.int32(), nullable=False),
        pa.field("instances", pa.int32(), nullable=False),
        pa.field("cost", pa.float64(), nullable=False),
        pa.field("rooms_entered", pa.int32(), nullable=False),
        pa.field("missed", pa.int32(), nullable=False),
    ]
)


def write_searches(study: Study, classes: tuple[str, ...], path: Path) -> None:
    """Write every search of every planner. A failed write leaves no partial file."""
    names = np.array(classes, dtype=object)
    buffer = io.BytesIO()
    with pq.ParquetWriter(buffer, _SEARCHES, compression="zstd") as writer:
        for one in study.searches:
            number = len(one.starts)
            for (task, planner), outcome in one.outcomes.items():
                columns = [
                    pa.array([one.scene_id] * number),
                    pa.array([one.world] * number),
                    pa.array([task] * number),
                    pa.array([planner] * number),
                    pa.array(np.arange(number), pa.int32()),
                    pa.array(names[one.artifacts].tolist(), pa.list_(pa.string())),
                    pa.array(one.starts, pa.int32()),
                    pa.array(one.draws, pa.int32()),
                    pa.array(one.instances, pa.int32()),
                    pa.array(outcome.costs),
                    pa.array(outcome.entered, pa.int32()),
                    pa.array(outcome.missed, pa.int32()),
                ]
                writer.write_batch(pa.record_batch(columns, schema=_SEARCHES))
    write_bytes(path, buffer.getvalue())


def encode_study(
    study: Study,
    results: list[WorldResult],
    *,
    classes: tuple[str, ...],
    facts: dict[str, Any],
) -> dict[str, Any]:
    """Return a study as JSON: facts, recipe and results; unknown values are null."""
    recipe = study.recipe.model_dump(mode="json")
    recipe["worlds"] = [world.name for world in study.recipe.worlds]
    chosen = study.recipe.artifacts
    recipe["artifacts"] = list(classes) if chosen is None else [classes[c] for c in chosen]
    return {
        **facts,
        "scenes": list(study.scenes),
        "recipe": recipe,
        "left_out": study.left_out,
        "standings": [_plain(asdict(one)) for one in results],
    }


def _plain(value: Any) -> Any:
    """Return nested records for JSON: an estimate becomes value and interval, unknown null."""
    if isinstance(value, dict):
        if "nodes" in value and "value" in value:
            if np.isnan(value["value"]):
                return None
            value = {end: value[end] for end in ("value", "low", "high")}
        return {key: _plain(inner) for key, inner in value.items()}
    return None if isinstance(value, float) and np.isnan(value) else value
