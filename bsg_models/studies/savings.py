"""Compute what planners save, the statistics of a search study, and write its searches.

A saving is 1 − Σ cost / Σ cost of `nearest` over the same searches, with a bootstrap interval over
buildings. Mean and median over single searches differ from it, because a few searches in which
`nearest` was lucky dominate the mean.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import groupby
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pyarrow as pa
import pyarrow.parquet as pq

from bsg_data.arrays import Floats
from bsg_models.evaluation.bootstrap import (
    LEAST_BUILDINGS,
    Estimate,
    estimate_value,
    weigh_buildings,
)
from bsg_models.rendering.pages import Table
from bsg_models.search.knowledge import Task
from bsg_models.studies.search_request import BASELINE, ROUTING, StudyRecipe
from bsg_models.studies.search_study import Study

_TIE = 1e-9  # relative difference below which two costs are a tie
_COLUMNS = {  # of `searches.parquet`
    "scene_id": pa.string(),
    "world": pa.string(),
    "task": pa.string(),
    "planner": pa.string(),
    "episode": pa.int32(),
    "artifacts": pa.list_(pa.string()),
    "start_room_index": pa.int32(),
    "draw": pa.int32(),
    "instances": pa.int32(),
    "cost": pa.float64(),
    "rooms_entered": pa.int32(),
}


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


def tabulate_savings(results: Sequence[WorldResult]) -> Iterator[Table]:
    """Yield a table for each world, by which the results are sorted: what each planner saves.

    A second line of its caption says how good the first belief is, if there is one.
    """
    for _, group in groupby(results, key=lambda result: result.world):
        tasks = list(group)
        header = [cell for result in tasks for cell in (f"{result.task}: saved, %", "wins, %")]
        rows = [
            [name, *(cell for result in tasks for cell in _cells(result, name))]
            for name in tasks[0].savings
        ]
        yield Table(_caption(tasks[0]), ["planner", *header], rows)


def _cells(result: WorldResult, planner: str) -> tuple[str, int]:
    saving = result.savings[planner]
    return _percent(saving.saved), round(100 * saving.wins / result.searches)


def _caption(result: WorldResult) -> str:
    buildings = f"{result.buildings} building{'s' if result.buildings > 1 else ''}"
    title = f"{result.world}: {result.searches:,} searches of {buildings} per task"
    if math.isnan(result.ranked_first):
        return title
    return (
        f"{title}\nthe likeliest room holds one in {result.ranked_first:.0%} of searches, a random "
        f"room in {result.chance:.0%}"
    )


def _percent(value: Estimate) -> str:
    """Return a share in per cent with its interval in whole per cent; a dash if unknown."""
    if math.isnan(value.value):
        return "-"
    text = f"{100 * value.value:.1f}"
    if math.isnan(value.low):
        return text
    return f"{text} ({round(100 * value.low)} to {round(100 * value.high)})"


def summarise(study: Study, *, resamples: int = 1000) -> list[WorldResult]:
    """Return the results of every world and task; too few resamples or buildings: no intervals."""
    return [
        _compare(study, searches, resamples=resamples)
        for _, searches in study.searches.groupby(["world", "task"], sort=False)
    ]


def _compare(study: Study, searches: pd.DataFrame, *, resamples: int) -> WorldResult:
    """Return the results of one world and task."""
    by_planner = {str(name): rows for name, rows in searches.groupby("planner", sort=False)}
    base = by_planner[BASELINE]
    building, scenes = pd.factorize(base.scene_id)
    size = resamples if len(scenes) >= LEAST_BUILDINGS else 0
    weights = weigh_buildings(len(scenes), resamples=size, seed=study.recipe.seed)
    weights = weights.T.astype(float, order="C")
    sums = {  # of all searches, then of each resample
        name: np.asarray(weights @ np.bincount(building, weights=rows.cost), dtype=float)
        for name, rows in by_planner.items()
    }
    saved = {name: np.asarray(1 - _divide(cost, sums[BASELINE])) for name, cost in sums.items()}
    return WorldResult(
        world=str(base.world.iloc[0]),
        task=base.task.iloc[0],
        buildings=len(scenes),
        searches=len(base),
        ranked_first=float(base.ranked_first.mean(skipna=False)),
        chance=float(base.chance.mean()),
        savings={
            name: _compare_planner(
                rows, base, saved, reads_belief=study.planners[name].reads == "belief"
            )
            for name, rows in by_planner.items()
        },
    )


def _compare_planner(
    ours: pd.DataFrame, base: pd.DataFrame, saved: Mapping[str, Floats], *, reads_belief: bool
) -> Saving:
    """Return the result of a planner; `saved` has, for each, the value and those of resamples."""

    def estimate(values: Floats) -> Estimate:
        return estimate_value(float(values[0]), values[1:], nodes=len(base), rule="percentile")

    own, unknown = saved[str(ours.planner.iloc[0])], np.array([np.nan])
    costs, off = base.cost.to_numpy(), ours.cost.to_numpy() - base.cost.to_numpy()
    each = 1 - np.divide(ours.cost, costs, out=np.ones_like(costs), where=costs > 0)
    return Saving(
        saved=estimate(own),
        beyond_routing=estimate(own - (saved.get(ROUTING, unknown) if reads_belief else unknown)),
        of_oracle=estimate(_divide(own, saved.get("oracle", unknown))),
        mean=float(each.mean()),
        median=float(np.median(each)),
        wins=int((off < -_TIE * costs).sum()),
        ties=int((np.abs(off) <= _TIE * costs).sum()),
        losses=int((off > _TIE * costs).sum()),
        cost=float(ours.cost.mean()),
        entered=float(ours.rooms_entered.mean()),
    )


def _divide(a: Floats, b: Floats) -> Floats:
    a, b = np.broadcast_arrays(a, b)
    return np.asarray(np.divide(a, b, out=np.full(a.shape, np.nan), where=b != 0))


def saving_of_buildings(searches: pd.DataFrame) -> pd.DataFrame:
    """Return what each planner saves in each building of a world and task, by column and row."""
    costs = searches.pivot_table("cost", "scene_id", "planner", aggfunc="sum", sort=False)
    ratio = costs.div(costs[BASELINE], axis=0)
    return 1 - ratio.where(costs[BASELINE] > 0, 1.0)


def write_searches(study: Study, path: Path) -> None:
    """Write every search of every planner."""
    fields = [pa.field(name, kind, nullable=False) for name, kind in _COLUMNS.items()]
    columns, schema = study.searches[[*_COLUMNS]], pa.schema(fields)
    table = pa.Table.from_pandas(columns, schema=schema, preserve_index=False)
    pq.write_table(table.replace_schema_metadata(None), path, compression="zstd")


def encode_study(
    study: Study, results: list[WorldResult], *, classes: tuple[str, ...], facts: dict[str, Any]
) -> dict[str, Any]:
    """Return a study as JSON: facts, recipe and results; unknown values are null."""
    recipe = study.recipe.model_dump(mode="json", include=set(StudyRecipe.model_fields))
    recipe["worlds"] = [world.name for world in study.recipe.worlds]
    recipe["artifacts"] = [name for name in classes if name in (study.recipe.artifacts or classes)]
    return {
        **facts,
        "scenes": list(study.scenes),
        "recipe": recipe,
        "left_out": study.left_out,
        "standings": [_plain(asdict(result)) for result in results],
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
