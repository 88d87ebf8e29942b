"""One search as it went: what the robot knew and believed in every room that it entered.

The search is not run again: its steps were kept by the study, and are folded into views.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

from bsg_data.arrays import Bools
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.histograms import to_histograms
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.observation.masks import sample_withheld
from bsg_data.observation.partial_graph import PartialGraph, enter_room, mask_scene
from bsg_data.scene.parts import find_wholes, load_parts
from bsg_data.scene.scene_graph import SceneGraph
from bsg_models.belief.belief_graph import believe
from bsg_models.rendering.explorer import Moment, View
from bsg_models.runs.predictor import Predictor
from bsg_models.search.shortest_paths import Floats
from bsg_models.studies.search_cases import StudyRecipe
from bsg_models.studies.search_steps import KeptSearch


def replay_search(dataset: Path, run: Path, recipe: StudyRecipe, kept: KeptSearch) -> list[View]:
    """Return what the robot knew at the start and in every room that it entered, in order.

    Args:
        dataset: that was searched.
        run: whose beliefs are shown, and which the study asked.
        recipe: of the study.
        kept: the search, as the study kept it.

    Raises:
        DatasetError: if the dataset does not have the building.
        RecipeError: if artifacts were put where the model believes them, and not where they are.
    """
    if recipe.truth == "posterior":
        raise RecipeError("a replay shows searches for what is really there, not truth posterior")
    graph = _find_building(dataset, kept.scene_id)
    truth = to_histograms(Dataset.open(dataset).cells(kept.scene_id))
    holds = np.flatnonzero(truth[1:, list(kept.artifacts)].any(axis=1)) + 1
    predictor = Predictor(run)
    start = _known_at_start(dataset, recipe, kept, graph)
    withheld = _withheld_at_start(start, recipe, kept)
    views = []
    known_and_moments = zip(
        _explore(start, graph, kept),
        _moments(kept, holds=tuple(holds.tolist())),
        strict=True,
    )
    for known, moment in known_and_moments:
        withheld[list(moment.route)] = False
        withheld[0] &= known.hidden_share > 0
        expectation = predictor(known, withheld=withheld)
        views.append(View(believe(known, expectation, model=predictor.name), truth, moment=moment))
    return views


def _find_building(dataset: Path, scene_id: str) -> SceneGraph:
    for graph in read_scene_graphs(dataset):
        if graph.scene_id == scene_id:
            return graph
    raise DatasetError(f"{dataset}: has no scene {scene_id!r}")


def _known_at_start(
    dataset: Path, recipe: StudyRecipe, kept: KeptSearch, graph: SceneGraph
) -> PartialGraph:
    """Return what the mask leaves, without any instance of the artifacts, or part of one."""
    data = Dataset.open(dataset)
    class_space, cells = data.manifest.class_space, data.cells(kept.scene_id)
    partial = mask_scene(graph, recipe.mask, draw=kept.draw, class_space=class_space)
    categories = tuple(obj.category or "" for obj in partial.objects)
    parts = load_parts() if recipe.parts else {}
    wholes = find_wholes(categories, class_space.classes, parts).tolist()
    visible = tuple(
        obj
        for obj, whole in zip(partial.objects, wholes, strict=True)
        if obj.class_index not in kept.artifacts
        and not (
            obj.class_index is None
            and whole in kept.artifacts
            and obj.room_index
            and cells[obj.room_index, whole]
        )
    )
    return replace(partial, objects=visible)


def _withheld_at_start(start: PartialGraph, recipe: StudyRecipe, kept: KeptSearch) -> Bools:
    """Return where nothing of a class is shown, `[1 + R, C]`: artifacts, and what a mask withheld.

    A mask withholds nothing in rooms of which it shows all, but artifacts also there.
    """
    classes = sample_withheld(
        recipe.mask,
        scene_id=kept.scene_id,
        draw=kept.draw,
        classes=len(start.class_space.classes),
    )
    share = np.array([start.hidden_share, *(room.hidden_share for room in start.rooms)])
    withheld: Bools = classes & (share > 0)[:, None]
    withheld[:, list(kept.artifacts)] = True
    return withheld


def _explore(known: PartialGraph, graph: SceneGraph, kept: KeptSearch) -> Iterator[PartialGraph]:
    """Yield what the robot knows after it has entered each room."""
    for room in (kept.start, *(step.entered for step in kept.steps)):
        known = enter_room(known, graph, room)
        yield known


def _moments(kept: KeptSearch, *, holds: tuple[int, ...]) -> Iterator[Moment]:
    """Yield where the robot is before each step, and at the end."""
    route: tuple[int, ...] = (kept.start,)
    cost = 0.0
    for step in (*kept.steps, None):
        yield Moment(
            artifacts=kept.artifacts,
            route=route,
            cost=cost,
            target=None if step is None else step.target,
            legs=() if step is None else _legs(step.distance),
            holds=holds,
            planner=kept.planner,
            world=kept.world,
        )
        if step is not None:
            route, cost = (*route, step.entered), cost + float(step.distance[step.entered])


def _legs(distance: Floats) -> tuple[float | None, ...]:
    return tuple(round(float(cost), 3) if np.isfinite(cost) else None for cost in distance)
