"""Run one search of a study again, and prepare it for a page, stop by stop.

A caller may name a search by its number. Without a number, it is the first eventful one: at most
`MOST_HOLDING` of the rooms hold the artifact, and both robots enter `LEAST_ENTERED` rooms or more.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Literal, cast

import numpy as np

from bsg_data.arrays import Counts
from bsg_data.dataset.dataset import Dataset
from bsg_data.scene.scene_graph import Room
from bsg_models.rendering.plan import KnownOutline, draw_plan, outline_room
from bsg_models.rendering.replay import Replay, Visit, Walk
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.knowledge import Travel
from bsg_models.search.room_graphs import MEASURED
from bsg_models.search.simulator import Episodes, Robot, Step, search
from bsg_models.studies.savings import Saving, WorldResult
from bsg_models.studies.search_beliefs import ask_run
from bsg_models.studies.search_cases import sample_episodes
from bsg_models.studies.search_request import BASELINE, StudyRecipe
from bsg_models.studies.search_study import Study
from bsg_models.zoo.model import one_thread

MOST_HOLDING = 0.25  # share of the rooms, without the start
LEAST_ENTERED = 4  # rooms, without the start
_NAMED_CLASSES = 6  # of a room
_NAMED = "This search was named by its number, so it need not be typical."
_UNEVENTFUL = (
    "This is the first search. None is eventful: artifacts are in many rooms, or a robot finds one "
    "within a few rooms."
)
_EVENTFUL = (
    "This is the first search that is worth watching: at most "
    f"{100 * MOST_HOLDING:.0f} % of the rooms hold what is sought, and every robot enters at least "
    f"{LEAST_ENTERED} rooms."
)


def replay_search(
    data: Dataset,
    study: Study,
    results: Sequence[WorldResult],
    runs: Mapping[str, Path | None],
    *,
    model: str | None,
    trace: int | Literal["auto"],
) -> Replay:
    """Return a search by one planner and by `nearest`, with the means over all searches.

    Its costs are in metres if the study has such searches. Of those with a number, it is that of
    the first building.

    Args:
        data: that was searched.
        study: of its searches.
        results: of the study.
        runs: building → run whose beliefs were used.
        model: name of the model of these runs.
        trace: number of the search in its building; `auto` for the first eventful one.
    """
    task, names = study.recipe.tasks[0], data.manifest.class_space.classes
    searched = set(study.searches.world)
    worlds = [world for world in study.recipe.worlds if world.name in searched]
    world = min(worlds, key=lambda world: world.kind not in MEASURED)
    scene_id, number, chosen = _choose_search(study, world.name, trace)
    episodes = cast(Episodes, sample_episodes(data, scene_id, world, study.recipe))
    episode = _take_one(episodes, number)
    steps = _walk(study, episode, number, data, scene_id, runs[scene_id])
    result = next(part for part in results if (part.world, part.task) == (world.name, task))
    graph = next(graph for graph in data.read_graphs() if graph.scene_id == scene_id)
    rooms, is_measured = set(np.flatnonzero(episode.rooms).tolist()), world.kind in MEASURED
    return Replay(
        scene_id=scene_id,
        episode=number,
        artifacts=(names[episode.artifacts[0, 0]],),
        task=task,
        world=world.name,
        unit="m" if is_measured else "",
        plan=draw_plan([_outline(room) for room in graph.rooms if room.room_index in rooms]),
        doors=tuple(
            (edge.source, edge.target)
            for edge in graph.adjacency
            if is_measured and {edge.source, edge.target} <= rooms
        ),
        holds=tuple(np.flatnonzero(episode.rooms & episode.instances[0].any(axis=1)).tolist()),
        left_out=len(graph.rooms) - len(rooms),
        walks=tuple(
            _describe_walk(
                planner,
                list(_list_visits(steps[planner], episode, data.cells(scene_id), names)),
                result.savings[planner],
                model=model if study.planners[planner].reads == "belief" else None,
            )
            for planner in steps
        ),
        searches=result.searches,
        buildings=result.buildings,
        chosen=chosen,
    )


def _outline(room: Room) -> KnownOutline:
    name = room.source_label or room.label or f"room {room.region_id}"
    return KnownOutline(room.room_index, name, outline_room(room, room.centroid), room.floor_index)


def _describe_walk(
    planner: str, visits: Sequence[Visit], saving: Saving, *, model: str | None
) -> Walk:
    """Return a walk with the means over all searches; without a model it shows no belief."""
    if model is None:
        visits = [replace(visit, presence=None) for visit in visits]
    return Walk(planner, model, tuple(visits), saving.cost, saving.entered, saving.saved)


def _choose_planner(recipe: StudyRecipe) -> str:
    """Return the planner that uses beliefs most."""
    names = [name for name in recipe.planners if PLANNERS[name].reads == "belief"]
    return "expected-cost" if "expected-cost" in names else (names or recipe.planners)[0]


def _choose_search(study: Study, world: str, trace: int | Literal["auto"]) -> tuple[str, int, str]:
    """Return building and number of a search in a world, and how it was chosen."""
    every, both = study.searches, (_choose_planner(study.recipe), BASELINE)
    every = every[(every.world == world) & (every.task == study.recipe.tasks[0])]
    if trace != "auto":
        return str(every.scene_id.iloc[0]), trace, _NAMED
    searches = every[every.planner.isin(both)]
    searches = searches.groupby(["scene_id", "episode"], sort=False, as_index=False).agg(
        {"rooms_entered": "min", "chance": "first"}
    )
    eventful = (searches.chance <= MOST_HOLDING) & (searches.rooms_entered >= LEAST_ENTERED)
    first = searches.iloc[int(eventful.to_numpy().argmax())]  # of none, the first of all
    return str(first.scene_id), int(first.episode), _EVENTFUL if eventful.any() else _UNEVENTFUL


def _take_one(episodes: Episodes, number: int) -> Episodes:
    """Return one search of many."""
    rows = slice(number, number + 1)
    return replace(
        episodes,
        travel=Travel(episodes.travel.costs[rows], episodes.travel.steps[rows]),
        starts=episodes.starts[rows],
        artifacts=episodes.artifacts[rows],
        instances=episodes.instances[rows],
        luck=None if episodes.luck is None else episodes.luck[rows],
    )


def _walk(
    study: Study, episode: Episodes, number: int, data: Dataset, scene_id: str, run: Path | None
) -> dict[str, list[Step]]:
    """Return the steps of the planner and of `nearest` in one search."""
    recipe = study.recipe
    steps: dict[str, list[Step]] = {_choose_planner(recipe): [], BASELINE: []}
    robots = {name: Robot(study.planners[name], recipe.tasks[0]) for name in steps}
    draws = np.array([number % recipe.draws])
    with one_thread():
        beliefs = None if run is None else ask_run(run, data, scene_id, recipe, episode, draws)
        search(episode, robots, beliefs=beliefs, watch=lambda name, step: steps[name].append(step))
    return steps


def _list_visits(
    walk: Sequence[Step], episode: Episodes, cells: Counts, classes: Sequence[str]
) -> Iterator[Visit]:
    """Yield the start of a robot, then each room that it enters in a search."""
    room, artifact, cost = int(episode.starts[0]), int(episode.artifacts[0, 0]), 0.0
    way: tuple[int, ...] = ()
    for step in (*walk, None):
        known = step or (walk[-1] if walk else None)
        target = None if step is None else int(step.target[0])
        yield Visit(
            room=room,
            way=way,
            cost=round(cost, 3),
            seen=tuple(_list_seen(cells[room], artifact, classes)),
            found=(classes[artifact],) if cells[room, artifact] else (),
            presence=None if known is None else _believe(known, room),
            target=target,
            leg=None if step is None else round(float(step.known.distance[0, target]), 3),
        )
        if step is not None:
            way, room = _way_of(step), int(step.entered[0])
            cost += float(step.known.distance[0, room])


def _way_of(step: Step) -> tuple[int, ...]:
    """Return the rooms after the robot's own, up to the one that it enters."""
    way = [int(step.towards[0, step.known.here[0]])]
    while way[-1] != step.entered[0]:
        way.append(int(step.towards[0, way[-1]]))
    return tuple(node for node in way if node)  # node 0 is the building, not a room


def _list_seen(counts: Counts, artifact: int, classes: Sequence[str]) -> list[tuple[str, int]]:
    """Return the content of a room: the artifact first, then the most frequent classes."""
    seen = np.flatnonzero(counts).tolist()
    seen.sort(key=lambda c: (c != artifact, -counts[c]))
    return [(classes[c], int(counts[c])) for c in seen[:_NAMED_CLASSES]]


def _believe(step: Step, room: int) -> tuple[float, ...]:
    """Return P(a room holds the artifact), `[R]`."""
    presence = step.known.presence[0, 1:, 0].copy()
    presence[room - 1] = 0.0
    return tuple(np.round(presence, 4).tolist())
