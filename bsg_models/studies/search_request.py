"""Say what to search: the request of a study, and the buildings, runs and recipe that it means."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError, MismatchError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.recipes import Record, Share
from bsg_data.registry import require_known
from bsg_models.inputs.folds import Split, scenes_of
from bsg_models.rendering.animation import require_suffix
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.found_model import DEFAULT_MODEL, locate_run, name_run, shipped_names
from bsg_models.runs.model_summary import describe_model
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.room_graphs import (
    DEFAULT_WORLDS,
    MEASURED,
    METHODS,
    WorldRecipe,
    parse_world,
)
from bsg_models.studies.search_cases import StudyRecipe

ROOM_SPECIFIC = (
    "stove",
    "refrigerator",
    "bathtub",
    "toilet",
    "microwave",
    "sink",
    "shower",
    "washing machine",
    "bed",
    "nightstand",
)
_Chosen = dict[str, Path | None]  # building → run to ask


class SearchRequest(Record):
    """Which buildings to search, how, and what to write."""

    dataset: Path  # folder of a split dataset
    # trained models or checkpoints, as `locate_run` finds them; for a dataset of folds, one per
    # fold that is searched
    runs: tuple[Path, ...] = ()
    split: Literal["train", "val", "test", "all"] = "test"  # `all` only without runs
    scene: str | None = None  # search this building alone
    # names; None for all, or without runs for those that read no belief
    planners: tuple[str, ...] | None = None
    # as `parse_world` reads them; None for the default ones and those that the dataset knows
    worlds: tuple[str, ...] | None = None
    task: Literal["single", "all", "both"] = "both"
    artifacts: tuple[str, ...] = ("every",)  # names of classes, or `every`, or `room-specific`
    mask: str = "uniform"  # the recipe's `strategy`
    # of the recipe
    stops: tuple[float, ...] = ()
    at_once: int = Field(default=1, ge=1)
    episodes: int = Field(default=200, ge=1)
    masks: int = Field(default=10, ge=1)
    fraction: float = Field(default=0.5, gt=0, le=1)
    withhold: Share = 0.0
    parts: bool = False
    truth: Literal["real", "posterior"] = "real"
    seed: int = Field(default=0, ge=0)
    resamples: int = Field(default=1000, ge=0)  # of the buildings
    # number of the search of the first building to replay; `auto` chooses one by the rule of
    # `kept_searches`
    trace: Annotated[int, Field(ge=0)] | Literal["auto"] | None = None
    animation: Path | None = None  # file for the replay, in the format of its suffix
    out: Path | None = None  # None for `search` in the first run or, without runs, here
    force: bool = False  # replace existing results

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        inside = self.runs and self.runs[0].is_dir()
        return self.out or (self.runs[0] / "search" if inside else Path("search"))


def choose_default_run(
    dataset: AnyPath, *, planners: Sequence[str] | None, split: str
) -> tuple[tuple[Path, ...], str]:
    """Return the default model for a search that names none, and a line about it.

    No model is returned, and the line says why, if no planner reads a belief, the buildings may
    have been in its training (`all`), none is shipped, or the dataset has other classes or folds.

    Raises:
        DatasetError: if the dataset is damaged.
        CheckpointError: if the shipped model is damaged.
    """
    why = ""
    if planners is not None and all(PLANNERS[name].reads != "belief" for name in planners):
        why = "no planner reads one"
    elif split == "all":
        why = "--split all may include buildings of its training"
    elif DEFAULT_MODEL not in shipped_names():
        why = f"no model {DEFAULT_MODEL!r} is shipped with this build"
    if why:
        return (), f"without a belief: {why}"
    run, data = locate_run(DEFAULT_MODEL), Dataset.open(dataset)
    header, space = read_header(run), data.manifest.class_space
    if header.class_space != space:
        why = f"predicts classes of {header.class_space}, the dataset has those of {space}"
    elif "fold-0" in data.splits:
        why = "was not trained for these folds"
    if why:
        return (), f"without a belief: the model {DEFAULT_MODEL!r} {why}"
    return (run,), f"model: {describe_model()}"


def make_recipe(request: SearchRequest, classes: Sequence[str]) -> StudyRecipe:
    """Return the recipe of the study that a request asks for."""
    chosen = {"worlds", "tasks", "planners", "artifacts", "strategy"}
    recipe = StudyRecipe(
        worlds=_choose_worlds(request),
        tasks=("single", "all") if request.task == "both" else (request.task,),
        planners=_choose_planners(request),
        artifacts=_choose_artifacts(request.artifacts, classes),
        strategy=request.mask,
        **request.model_dump(include=set(StudyRecipe.model_fields) - chosen),
    )
    if request.stops and request.task == "single":
        raise RecipeError("--stop needs --task all or both")
    if request.animation is not None:
        require_suffix(request.animation)
        if request.trace is None:
            raise RecipeError("--animation shows a replay: add --trace")
    needs = {
        **{f"planner {name!r}": PLANNERS[name].reads == "belief" for name in recipe.planners},
        "--trace": request.trace is not None,
        "--stop": bool(request.stops),
        "--truth posterior": request.truth == "posterior",
    }
    needing = [what for what, is_so in needs.items() if is_so]
    if needing and not request.runs:
        raise RecipeError(f"{needing[0]} needs a belief; name a --model")
    return recipe


def _choose_worlds(request: SearchRequest) -> tuple[WorldRecipe, ...]:
    if request.worlds is not None:
        return tuple(dict.fromkeys(parse_world(text) for text in request.worlds))
    known = Dataset.open(request.dataset).connection_methods
    measured = (WorldRecipe(kind=kind) for kind in MEASURED if known & set(METHODS[kind]))
    return (*DEFAULT_WORLDS, *measured)


def _choose_planners(request: SearchRequest) -> tuple[str, ...]:
    if request.planners is None:
        return tuple(n for n in PLANNERS if request.runs or PLANNERS[n].reads != "belief")
    PLANNERS.require(request.planners)
    return request.planners


def _choose_artifacts(names: tuple[str, ...], classes: Sequence[str]) -> tuple[int, ...] | None:
    if names == ("every",):
        return None
    wanted = ROOM_SPECIFIC if names == ("room-specific",) else names
    require_known("class", wanted, classes)
    return tuple(sorted({classes.index(name) for name in wanted}))


def choose_buildings(request: SearchRequest, data: Dataset) -> tuple[_Chosen, list[str]]:
    """Return building → run to ask, and notes about the choice."""
    split, folds = request.split, "fold-0" in data.splits
    chosen: _Chosen
    notes: list[str] = []
    if request.runs:
        if split == "all":
            raise RecipeError(
                "--split all would search buildings that the RUN was trained on; name a split"
            )
        chosen, notes = choose_runs(data, request.runs, part=split)
        if split == "train":
            notes.append(
                "the runs were trained on these buildings: expect smaller savings elsewhere"
            )
        missing = len(chosen) < len(data.scene_ids)
        if folds and split == "test" and request.scene is None and missing:
            notes.append(
                f"{len(chosen)} of {len(data.scene_ids)} buildings searched: give a --run for "
                "every fold"
            )
    elif folds and split not in ("all", "test"):
        raise RecipeError(f"--split {split} of a dataset of folds needs a --run")
    elif split == "all" or folds:
        chosen = dict.fromkeys(data.scene_ids)
    else:
        chosen = dict.fromkeys(scenes_of(data, split))
    if request.scene is not None:
        if request.scene not in chosen:
            raise DatasetError(
                f"{data.path}: {request.scene!r} is not one of its {split} buildings"
            )
        chosen = {request.scene: chosen[request.scene]}
    return chosen, notes


def choose_runs(
    data: Dataset, runs: Sequence[Path], *, part: Split = "test"
) -> tuple[_Chosen, list[str]]:
    """Return building → run to ask, and notes about the choice.

    In a dataset of folds, each run answers about the fold that it was not trained on.
    """
    chosen: _Chosen = {}
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
                f"{name_run(run)}: was trained for no fold, and {data.path} is in folds; name a "
                "run for each fold, or split the dataset with --ratios"
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
