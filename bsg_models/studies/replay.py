"""Prepare one search, by a planner and by `nearest`, for a page or an animation.

The search is not run again: the study kept its stops.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import RecipeError
from bsg_models.rendering.plan import KnownOutline, draw_plan, outline_room
from bsg_models.rendering.replay import Replay, Walk
from bsg_models.search.room_graphs import MEASURED
from bsg_models.studies.kept_searches import (
    LEAST_ENTERED,
    MOST_HOLDING,
    TYPICAL,
    KeptSearch,
    choose_shown,
)
from bsg_models.studies.savings import WorldResult
from bsg_models.studies.search_study import Study

_NAMED = "This search was named by its number, so it need not be typical."
_NOT_EVENTFUL = (
    "This search was chosen as worth watching, but no search met the rule: artifacts are in many "
    "rooms, or a robot finds one within a few rooms. Of the searches whose saving is nearest to "
    "that of all, it is the one in which beliefs change most."
)
_EVENTFUL = (
    "This search was chosen as worth watching, by a rule. "
    f"At most {100 * MOST_HOLDING:.0f} % of the rooms hold what is sought, and every robot enters "
    f"at least {LEAST_ENTERED} rooms. The saving is within {100 * TYPICAL:.0f} points of that of "
    "all searches, or as near as there is. Of these searches, beliefs change most in this one."
)


def choose_replay(study: Study, results: Sequence[WorldResult], *, named: bool) -> KeptSearch:
    """Return the kept search to show; one with costs in metres if there is one.

    Of searches that were `named` by number, the first building's is shown.
    """
    if not study.kept:
        raise RecipeError("the study kept no search; pass a KeepRequest to `study_search`")
    world = min((one.world for one in study.kept), key=lambda name: name not in MEASURED)
    there = [one for one in study.kept if one.world == world]
    if named:
        return there[0]
    saving = _result_of(results, there[0]).savings[there[0].planner]
    return choose_shown(there, saving.saved.value)


def replay_search(
    dataset: Path,
    study: Study,
    results: Sequence[WorldResult],
    kept: KeptSearch,
    *,
    model: str | None,
    named: bool,
) -> Replay:
    """Return a kept search stop by stop, with the means over all searches of the study.

    `model` is that whose beliefs the study used; `named` says that the search was named by its
    number instead of chosen by the rule.
    """
    graph = next(one for one in read_scene_graphs(dataset) if one.scene_id == kept.scene_id)
    result, walks = _result_of(results, kept), []
    for planner, stops in kept.walks.items():
        saving = result.savings[planner]
        walks.append(
            Walk(
                planner=planner,
                model=model if study.planners[planner].reads == "belief" else None,
                stops=stops,
                mean_cost=saving.cost,
                mean_entered=saving.entered,
                mean_saved=saving.saved,
            )
        )
    measured = kept.world in MEASURED
    return Replay(
        scene_id=kept.scene_id,
        episode=kept.episode,
        artifacts=kept.artifacts,
        task=kept.task,
        world=kept.world,
        unit="m" if measured else "",
        plan=draw_plan(
            [
                KnownOutline(
                    room.room_index,
                    room.source_label or room.label or f"room {room.region_id}",
                    outline_room(room, room.centroid),
                    room.floor_index,
                )
                for room in graph.rooms
                if room.room_index in kept.rooms
            ]
        ),
        doors=tuple(
            (edge.source, edge.target)
            for edge in graph.adjacency
            if measured and {edge.source, edge.target} <= set(kept.rooms)
        ),
        holds=kept.holds,
        left_out=len(graph.rooms) - len(kept.rooms),
        walks=tuple(walks),
        searches=result.searches,
        buildings=result.buildings,
        chosen=_NAMED if named else _EVENTFUL if kept.eventful else _NOT_EVENTFUL,
    )


def _result_of(results: Sequence[WorldResult], kept: KeptSearch) -> WorldResult:
    return next(one for one in results if (one.world, one.task) == (kept.world, kept.task))
