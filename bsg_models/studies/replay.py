"""One search as it went: what the robot knew and believed in every room that it entered."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import to_histograms
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import DatasetError
from bsg_data.observation.partial_graph import enter_room, mask_scene
from bsg_models.belief.belief_graph import believe
from bsg_models.rendering.explorer import Moment, View
from bsg_models.runs.predictor import Predictor
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.knowledge import Task
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.search.shortest_paths import Bools, Floats, Ints
from bsg_models.search.simulator import Beliefs, Step, search
from bsg_models.studies.search_cases import StudyRecipe, sample_case
from bsg_models.studies.search_study import ask_run, measure_building


@dataclass(frozen=True, slots=True)
class TraceRequest:
    """Which search is to be replayed.

    Attributes:
        scene_id: of the building.
        episode: number of the search in it.
        world: where it takes place.
        task: when it ends.
        planner: that decides.
    """

    scene_id: str
    episode: int
    world: WorldRecipe
    task: Task
    planner: str


def trace_search(
    dataset: Path, run: Path, recipe: StudyRecipe, request: TraceRequest
) -> list[View]:
    """Return what the robot knew at the start and in every room that it entered, in order.

    Raises:
        DatasetError: if there is no such search.
    """
    data = Dataset.open(dataset)
    measured = measure_building(data, request.scene_id, [request.world])
    case = sample_case(
        data.cells(request.scene_id),
        request.world,
        recipe,
        scene_id=request.scene_id,
        measured=measured,
    )
    if isinstance(case, str):
        raise DatasetError(f"{request.scene_id}: has no searches ({case})")
    if request.episode >= len(case.episodes.starts):
        raise DatasetError(f"{request.scene_id}: has no search number {request.episode}")
    beliefs = ask_run(run, data, request.scene_id, recipe.mask, case)
    steps: list[Step] = []
    search(
        case.episodes.take(_one(request.episode)),
        PLANNERS[request.planner],
        task=request.task,
        beliefs=_OneSearch(beliefs, request.episode),
        watch=steps.append,
    )
    graph = next(g for g in read_scene_graphs(dataset) if g.scene_id == request.scene_id)
    artifacts = tuple(case.episodes.artifacts[request.episode].tolist())
    start = int(case.episodes.starts[request.episode])
    partial = mask_scene(
        graph,
        recipe.mask,
        draw=int(case.draws[request.episode]),
        class_map=read_manifest(dataset).class_map,
    )
    kept = tuple(obj for obj in partial.objects if obj.class_index not in artifacts)
    predictor = Predictor(run)
    truth = to_histograms(data.cells(request.scene_id))
    holds = tuple(room for room in range(1, len(truth)) if truth[room, list(artifacts)].any())
    views, route, cost = [], [start], 0.0
    known = enter_room(replace(partial, objects=kept), graph, start)
    for step in [*steps, None]:
        belief = believe(known, predictor(known, withheld=artifacts), model=predictor.name)
        moment = Moment(
            artifacts=artifacts,
            route=tuple(route),
            cost=cost,
            target=None if step is None else int(step.target[0]),
            legs=() if step is None else _legs(step.known.distance[0]),
            holds=holds,
            planner=request.planner,
            world=request.world.name,
        )
        views.append(View(belief, truth, moment=moment))
        if step is not None:
            place = int(step.entered[0])
            cost += float(step.known.distance[0, place])
            route.append(place)
            known = enter_room(known, graph, place)
    return views


def _legs(distance: Floats) -> tuple[float | None, ...]:
    return tuple(round(float(cost), 3) if np.isfinite(cost) else None for cost in distance)


class _OneSearch:
    """The beliefs about one of many searches."""

    def __init__(self, beliefs: Beliefs, number: int) -> None:
        self._beliefs, self._number = beliefs, number

    def __call__(self, rows: Ints, explored: Bools) -> tuple[Floats, Floats]:
        return self._beliefs(_one(self._number), explored)


def _one(number: int) -> Ints:
    return np.array([number])
