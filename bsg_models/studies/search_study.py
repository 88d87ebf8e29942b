"""Compare planners over many searches of the buildings of a dataset.

Every planner meets the same searches: the same worlds, starts, artifacts and masks. They depend
only on the recipe and the building.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path

import numpy as np

from bsg_data.arrays import Floats, Ints
from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError, MismatchError, RecipeError
from bsg_data.executors import run_all
from bsg_data.files import AnyPath
from bsg_data.recipes import MaskRecipe
from bsg_models.inputs.folds import Split, scenes_of
from bsg_models.runs.checkpoint import load_checkpoint, read_header, restore_model
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.runs.shipped import name_run
from bsg_models.search.catalogue import PLANNERS, Planner
from bsg_models.search.knowledge import Task
from bsg_models.search.room_graphs import (
    MEASURED,
    METHODS,
    WorldRecipe,
    world_generator,
)
from bsg_models.search.simulator import Beliefs, Outcome, Robot, Step, search
from bsg_models.studies.search_beliefs import FixedBeliefs, ModelBeliefs
from bsg_models.studies.search_cases import (
    BASELINE,
    ROUTING,
    Case,
    StudyRecipe,
    measure_building,
    sample_case,
    sample_presence,
)
from bsg_models.studies.search_steps import (
    KeepRequest,
    KeptSearch,
    belief_changes,
    choose_kept,
    find_eventful,
    walk_of,
)
from bsg_models.zoo.model import BeliefModel, one_thread

_SWEEP = -1.0  # a threshold never reached: such a search enters every room


@dataclass(frozen=True, eq=False)
class Searches:
    """The searches of one building in one world, and the outcome of each planner."""

    scene_id: str  # of the building
    world: str  # its name
    starts: Ints  # `[E]` rooms
    artifacts: Ints  # `[E, A]` classes
    draws: Ints  # `[E]` number of the mask
    instances: Ints  # `[E]` of the artifacts
    # `[E]` whether the likeliest room at the start holds one; NaN without a belief
    ranked_first: Floats
    chance: Floats  # `[E]` share of the rooms that hold one
    # (task, planner) → outcome; (`all`, `stop 0.1`) is the robot that stops by itself, `sweep`
    # enters every room, nearest first
    outcomes: dict[tuple[Task, str], Outcome]
    kept: tuple[KeptSearch, ...] = ()  # those of the searches whose steps were asked for


@dataclass(frozen=True, eq=False)
class Study:
    """All searches of a study, and what could not be searched."""

    recipe: StudyRecipe  # that it was made by
    scenes: tuple[str, ...]  # buildings that were asked for
    searches: tuple[Searches, ...]  # of every building in every world
    left_out: dict[str, dict[str, int]]  # world → reason → number of buildings that it lacks
    planners: Mapping[str, Planner]  # name → planner, in the order of the tables


def study_search(
    dataset: AnyPath,
    runs: Mapping[str, AnyPath | None],
    recipe: StudyRecipe,
    *,
    planners: Mapping[str, Planner] | None = None,
    keep: KeepRequest | None = None,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> Study:
    """Search buildings with every planner.

    Args:
        dataset: folder; a measured world needs its room adjacency.
        runs: building → run whose beliefs are used; None if no planner reads a belief.
        recipe: of the study.
        planners: name → planner of your own, besides those of the recipe.
        keep: which searches keep their steps for `replay_search`; they are `kept` of `Searches`.
        executor: works on the buildings; None works in this process.
        progress: called with (buildings done, in all).

    Raises:
        DatasetError: if the dataset is damaged or no building can be searched.
        RecipeError: if a planner needs a belief and a building has no run; if an artifact is not a
            class; if your own planner has a taken name or cannot reach the executor; or if the
            recipe has no search that `keep` asks for.
    """
    dataset = Path(dataset)
    chosen = choose_planners(recipe, planners or {}, remote=executor is not None)
    _check_keep(keep, recipe, chosen)
    placed = {scene: None if run is None else Path(run).absolute() for scene, run in runs.items()}
    if recipe.truth == "posterior" and None in placed.values():
        raise RecipeError("truth posterior needs a belief: give the run of a model")
    own = {name: chosen[name] for name in planners or {}}
    place = dataset.absolute()  # a worker may run in another folder
    tasks = [(place, run, scene, recipe, own, keep) for scene, run in placed.items()]
    by_building = run_all(_search_building, tasks, executor=executor, progress=progress)
    left_out: dict[str, dict[str, int]] = {}
    searches = []
    for one in by_building:
        for world, result in one.items():
            if isinstance(result, str):
                reasons = left_out.setdefault(world, {})
                reasons[result] = reasons.get(result, 0) + 1
            else:
                searches.append(result)
    if not searches:
        why = "; ".join(f"{world}: {reason}" for world, all_ in left_out.items() for reason in all_)
        raise DatasetError(f"{dataset}: nothing can be searched ({why or 'no buildings'})")
    return Study(recipe, tuple(placed), tuple(searches), left_out, chosen)


def choose_planners(
    recipe: StudyRecipe, own: Mapping[str, Planner], *, remote: bool
) -> dict[str, Planner]:
    """Return the planners of a study by name: those of its recipe, and the caller's own."""
    for name in (*own, *recipe.all_planners):
        if name == "sweep" or name.startswith("stop ") or (name in own and name in PLANNERS):
            raise RecipeError(f"planner {name!r}: this name is taken; rename your planner")
    for name, planner in own.items():
        place = getattr(planner.choose, "__qualname__", "")
        if remote and ("<locals>" in place or "<lambda>" in place):
            raise RecipeError(
                f"planner {name!r}: other processes cannot import {place}; define the function at "
                "the top of a module, or search without an executor"
            )
    chosen = {name: PLANNERS[name] for name in recipe.all_planners} | dict(own)
    if any(planner.reads == "belief" for planner in own.values()):
        chosen.setdefault(ROUTING, PLANNERS[ROUTING])
    return chosen


def _check_keep(
    keep: KeepRequest | None, recipe: StudyRecipe, planners: Mapping[str, Planner]
) -> None:
    if keep is None:
        return
    if keep.episode is not None and not 0 <= keep.episode < recipe.episodes:
        raise RecipeError(
            f"no search {keep.episode}: a building has {recipe.episodes}, numbered from 0"
        )
    if keep.task not in recipe.tasks or keep.planner not in planners:
        raise RecipeError(f"the study has no task {keep.task!r} with planner {keep.planner!r}")


def choose_runs(
    dataset: Path, runs: Sequence[Path], *, part: Split = "test"
) -> tuple[dict[str, Path | None], list[str]]:
    """Return building → run to ask, and notes about the choice.

    In a dataset of folds, each run answers about the fold that it was not trained on.
    """
    data = Dataset.open(dataset)
    chosen: dict[str, Path | None] = {}
    notes, models = [], set()
    for run in runs:
        header = read_header(checkpoint_of(run))
        if header.class_space != data.manifest.class_space:
            raise MismatchError(
                f"{run}: predicts classes of {header.class_space}, the dataset has those of "
                f"{data.manifest.class_space}"
            )
        models.add(header.config.name)
        fold = header.config.data.fold if "fold-0" in data.splits else None
        if "fold-0" in data.splits and fold is None:
            raise DatasetError(
                f"{name_run(run)}: was trained for no fold, and {dataset} is in folds; name a run "
                "for each fold, or split the dataset with --ratios"
            )
        scenes = scenes_of(data, part, fold=fold)
        taken = sorted(set(scenes) & set(chosen))
        if taken:
            raise DatasetError(f"{run}: is for the same buildings as another run, e.g. {taken[0]}")
        if header.dataset_sha256 != data.sha256:
            notes.append(
                f"{name_run(run)}: was trained on another dataset or other pairs; it may have seen "
                "these buildings"
            )
        chosen.update(dict.fromkeys(scenes, run))
    if len(models) > 1:
        notes.append(f"the runs are of different models: {', '.join(sorted(models))}")
    return chosen, notes


def known_worlds(dataset: Path) -> tuple[WorldRecipe, ...]:
    """Return the measured worlds for which a dataset has at least one connection."""
    methods = Dataset.open(dataset).connection_methods
    return tuple(WorldRecipe(kind=kind) for kind in MEASURED if methods & set(METHODS[kind]))


def _search_building(
    dataset: Path,
    run: Path | None,
    scene_id: str,
    recipe: StudyRecipe,
    own: Mapping[str, Planner] | None = None,
    keep: KeepRequest | None = None,
) -> dict[str, Searches | str]:
    """Return world → the searches of one building with every planner, or why there are none."""
    data = Dataset.open(dataset)
    cells = data.cells(scene_id)
    planners = choose_planners(recipe, own or {}, remote=False)
    by_world: dict[str, Searches | str] = {}
    measured = measure_building(data, scene_id, recipe.worlds)
    asked: dict[bytes, ModelBeliefs] = {}  # worlds with the same rooms have the same searches
    with one_thread():
        for world in recipe.worlds:
            case = sample_case(cells, world, recipe, scene_id=scene_id, measured=measured)
            if isinstance(case, str):
                by_world[world.name] = case
                continue
            beliefs = None
            if run is not None:
                key = case.episodes.rooms.tobytes()
                if key not in asked:
                    asked[key] = _ask_run(run, data, scene_id, recipe.mask, case)
                beliefs = asked[key]
            by_world[world.name] = _compare_planners(
                case, world, recipe, scene_id, beliefs, planners, keep=keep
            )
    return by_world


def _ask_run(run: Path, data: Dataset, scene_id: str, mask: MaskRecipe, case: Case) -> ModelBeliefs:
    """Return the beliefs of a run about the searches of a building."""
    path = checkpoint_of(run)
    changed = path.stat().st_mtime_ns if path.exists() else 0
    return ModelBeliefs(
        _restore_once(path, changed),
        data=data,
        scene_id=scene_id,
        mask=mask,
        draws=case.draws,
        artifacts=case.episodes.artifacts,
    )


@lru_cache(maxsize=8)
def _restore_once(path: Path, changed: int) -> BeliefModel:
    return restore_model(path, load_checkpoint(path))


def _compare_planners(
    case: Case,
    world: WorldRecipe,
    recipe: StudyRecipe,
    scene_id: str,
    beliefs: Beliefs | None,
    planners: Mapping[str, Planner],
    *,
    keep: KeepRequest | None = None,
) -> Searches:
    """Return the outcome of every planner in the searches of one building in one world."""
    episodes = case.episodes
    every = np.arange(len(episodes.starts))
    ranked_first = np.full(len(every), np.nan)
    at_first = np.zeros((len(every), len(episodes.rooms)), dtype=bool)
    at_first[every, episodes.starts] = True
    open_ = episodes.rooms & ~at_first
    if beliefs is not None:
        first, share = beliefs(every, at_first)
        presence = np.where(open_[:, :, None], first, 0.0)
        if recipe.truth == "posterior":
            rng = world_generator(recipe.seed, scene_id, "posterior")
            there = sample_presence(presence, open_, rng)
            episodes = replace(episodes, instances=there.astype(np.int64))
            beliefs = FixedBeliefs(presence, share)
        likeliest = np.where(open_, 1 - (1 - presence).prod(axis=2), -1.0).argmax(axis=1)
        ranked_first = (episodes.instances[every, likeliest].sum(axis=1) > 0).astype(float)
    holds = (episodes.instances.sum(axis=2) > 0) & open_
    asked = keep if keep is not None and keep.fits(scene_id, world.name) else None
    steps: dict[str, list[Step]] = {} if asked is None else {asked.planner: [], BASELINE: []}

    def watch(key: tuple[Task, str], step: Step) -> None:
        task, name = key
        if asked is not None and asked.task == task and name in steps:
            steps[name].append(step)

    outcomes = search(episodes, _robots(recipe, planners), beliefs=beliefs, watch=watch)
    searches = Searches(
        scene_id=scene_id,
        world=world.name,
        starts=episodes.starts,
        artifacts=episodes.artifacts,
        draws=case.draws,
        instances=episodes.instances.sum(axis=(1, 2)),
        ranked_first=ranked_first,
        chance=holds.sum(axis=1) / open_.sum(axis=1),
        outcomes=outcomes,
    )
    return searches if asked is None else replace(searches, kept=_keep(searches, asked, steps))


def _robots(recipe: StudyRecipe, planners: Mapping[str, Planner]) -> dict[tuple[Task, str], Robot]:
    """Return the robots of a study by task and name: of each planner, and those that stop."""
    robots = {
        (task, name): Robot(planner, task)
        for task in recipe.tasks
        for name, planner in planners.items()
    }
    if "all" in recipe.tasks and recipe.stops:
        planned = PLANNERS["expected-cost"]
        for stop in recipe.stops:
            robots["all", f"stop {stop:g}"] = Robot(planned, "all", stop)
        robots["all", "sweep"] = Robot(PLANNERS[BASELINE], "all", _SWEEP)
    return robots


def _keep(
    searches: Searches, asked: KeepRequest, steps: Mapping[str, Sequence[Step]]
) -> tuple[KeptSearch, ...]:
    """Return the searches that were asked for, out of the steps of all searches by planner."""
    entered = [searches.outcomes[asked.task, name].entered for name in steps]
    eventful = find_eventful(searches.chance, entered)
    changes = belief_changes(steps[asked.planner], len(searches.starts))
    named = [] if asked.episode is None else [asked.episode]
    chosen = named or choose_kept(eventful, changes).tolist()
    return tuple(
        KeptSearch(
            scene_id=searches.scene_id,
            world=searches.world,
            task=asked.task,
            planner=asked.planner,
            episode=episode,
            start=int(searches.starts[episode]),
            artifacts=tuple(searches.artifacts[episode].tolist()),
            draw=int(searches.draws[episode]),
            eventful=bool(eventful[episode]),
            change=float(changes[episode]),
            walks={name: walk_of(of_all, episode) for name, of_all in steps.items()},
        )
        for episode in chosen
    )
