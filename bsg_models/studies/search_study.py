"""Compare planners over many searches of the buildings of a dataset.

Every planner meets the same searches: the same worlds, starts, artifacts and masks. They depend
only on the recipe and the building.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd

from bsg_data.arrays import Floats
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.executors import run_all
from bsg_data.files import AnyPath
from bsg_models.search.catalogue import PLANNERS, Planner
from bsg_models.search.knowledge import Task
from bsg_models.search.simulator import Beliefs, Episodes, Outcome, Robot, search, search_together
from bsg_models.studies.search_beliefs import ModelBeliefs, ask_run
from bsg_models.studies.search_cases import sample_episodes, sample_starts
from bsg_models.studies.search_request import ROUTING, StudyRecipe
from bsg_models.zoo.model import one_thread


@dataclass(frozen=True, eq=False)
class Study:
    """All searches of a study, and what could not be searched.

    Attributes:
        recipe: that it was made by.
        scenes: buildings that were asked for.
        searches: one row per search and planner, in the order of the buildings. Its columns are
            those of `searches.parquet`, `ranked_first` (whether the likeliest room at the start
            holds an artifact; NaN without a belief) and `chance` (share of the rooms that hold
            one).
        left_out: world → reason → number of buildings that it lacks.
        planners: name → planner, in the order of the tables.
    """

    recipe: StudyRecipe
    scenes: tuple[str, ...]
    searches: pd.DataFrame
    left_out: dict[str, Counter[str]]
    planners: Mapping[str, Planner]


def study_search(
    dataset: AnyPath,
    runs: Mapping[str, AnyPath | None],
    recipe: StudyRecipe,
    *,
    planners: Mapping[str, Planner] | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Search buildings with every planner.

    Args:
        dataset: folder; a measured world needs its room adjacency.
        runs: building → run whose beliefs are used; None if no planner reads a belief.
        recipe: of the study.
        planners: name → planner of your own, besides those of the recipe.
        executor: works on the buildings; None works in this process.
        progress: called with (buildings done, in all).

    Raises:
        DatasetError: if the dataset is damaged or no building can be searched.
        RecipeError: if a planner needs a belief and a building has no run, or if an artifact is not
            a class.
    """
    own = planners or {}
    extra = {ROUTING} if any(planner.reads == "belief" for planner in own.values()) else set()
    chosen = {name: PLANNERS[name] for name in (*recipe.all_planners, *extra)} | dict(own)
    placed = {scene: None if run is None else Path(run).absolute() for scene, run in runs.items()}
    place = Path(dataset).absolute()  # a worker may run in another folder
    sha256 = Dataset.open(place).sha256  # all workers search the same buildings
    tasks = [(place, sha256, run, scene, recipe, chosen) for scene, run in placed.items()]
    searches: list[pd.DataFrame] = []
    left_out: dict[str, Counter[str]] = {}
    for of_building, lacking in run_all(
        _search_building, tasks, executor=executor, progress=progress
    ):
        searches += of_building
        for world, reason in lacking.items():
            left_out.setdefault(world, Counter())[reason] += 1
    if not searches:
        why = "; ".join(f"{world}: {reason}" for world, all_ in left_out.items() for reason in all_)
        raise DatasetError(f"{dataset}: nothing can be searched ({why or 'no buildings'})")
    joined = pd.concat(searches, ignore_index=True)
    return Study(recipe, tuple(placed), joined, left_out, chosen)


def _search_building(
    dataset: Path,
    sha256: str,
    run: Path | None,
    scene_id: str,
    recipe: StudyRecipe,
    planners: Mapping[str, Planner],
) -> tuple[list[pd.DataFrame], dict[str, str]]:
    """Return the searches of a building in every world, and world → why it has none."""
    data = Dataset.open(dataset, sha256=sha256)
    searches, left_out = list[pd.DataFrame](), dict[str, str]()
    draws = np.arange(recipe.episodes) % recipe.draws
    asked: dict[bytes, ModelBeliefs] = {}  # worlds with the same rooms have the same searches
    with one_thread():
        for world in recipe.worlds:
            episodes = sample_episodes(data, scene_id, world, recipe)
            if isinstance(episodes, str):
                left_out[world.name] = episodes
                continue
            key = episodes.rooms.tobytes()
            if run is not None and key not in asked:
                asked[key] = ask_run(run, data, scene_id, recipe, episodes, draws)
            beliefs = asked.get(key)
            ranked_first = _rank_first(episodes, beliefs)
            outcomes = _search_world(episodes, recipe, scene_id, planners, beliefs)
            table = _tabulate(episodes, outcomes, data.manifest.class_space.classes)
            searches.append(
                table.assign(
                    scene_id=scene_id,
                    world=world.name,
                    draw=draws[table.episode],
                    ranked_first=ranked_first[table.episode],
                )
            )
    return searches, left_out


def _search_world(
    episodes: Episodes,
    recipe: StudyRecipe,
    scene_id: str,
    planners: Mapping[str, Planner],
    beliefs: Beliefs | None,
) -> dict[tuple[Task, str], Outcome]:
    """Return how the searches of each task and planner ended; of several robots, together."""
    robots = {
        (task, name): Robot(planner, task)
        for task in recipe.tasks
        for name, planner in planners.items()
    }
    if recipe.robots == 1:
        return search(episodes, robots, beliefs=beliefs)
    starts = sample_starts(episodes, recipe, scene_id)
    return {
        key: search_together(
            episodes, starts, beliefs=None if robot.planner.reads == "none" else beliefs
        )
        for key, robot in robots.items()
    }


def _rank_first(episodes: Episodes, beliefs: Beliefs | None) -> Floats:
    """Return whether the likeliest room at first holds an artifact, `[E]`; NaN without a belief."""
    every = np.arange(len(episodes.starts))
    if beliefs is None:
        return np.full(len(every), np.nan)
    explored = np.zeros((len(every), len(episodes.rooms)), dtype=bool)
    explored[every, episodes.starts] = episodes.look is None  # else it may hold the artifact
    open_ = episodes.rooms & ~explored
    presence = np.where(open_[:, :, None], beliefs(every, explored)[0], 0.0)
    likeliest = np.where(open_, 1 - (1 - presence).prod(axis=2), -1.0).argmax(axis=1)
    return np.asarray(episodes.instances[every, likeliest].any(axis=1), dtype=float)


def _tabulate(
    episodes: Episodes, outcomes: Mapping[tuple[Task, str], Outcome], classes: Sequence[str]
) -> pd.DataFrame:
    """Return one row per search and robot, with all that does not depend on the building."""
    names = np.array(classes, dtype=object)
    searches = pd.DataFrame(
        {
            "artifacts": names[episodes.artifacts].tolist(),
            "start_room_index": episodes.starts,
            "instances": episodes.instances.sum(axis=(1, 2)),
            "chance": episodes.random_success,
        }
    )
    ended = pd.concat(
        {key: pd.DataFrame(vars(outcome)) for key, outcome in outcomes.items()},
        names=["task", "planner", "episode"],
    )
    names_of_file = {"costs": "cost", "entered": "rooms_entered"}
    return ended.rename(columns=names_of_file).reset_index().join(searches, on="episode")
