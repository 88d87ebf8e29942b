"""Say what to search: the recipe of a study, the request of a command, its buildings and runs."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated, Any, Literal

from pydantic import Field, model_validator

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import require_class_space
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import AnyPath
from bsg_data.recipes import MaskRecipe, Seed
from bsg_data.records import Record
from bsg_data.registry import require_known
from bsg_models.inputs.folds import Split, scenes_of
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.found_model import DEFAULT_MODEL, locate_run, name_run, shipped_names
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.knowledge import Task
from bsg_models.search.room_graphs import (
    DEFAULT_WORLDS,
    MEASURED,
    METHODS,
    WorldRecipe,
    parse_world,
)

BASELINE, ROUTING = "nearest", "routing"
TEAM = (BASELINE, "expected-cost")  # planners of several robots
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


class StudyRecipe(Record):
    """Everything that a study depends on besides the dataset and the models."""

    worlds: tuple[WorldRecipe, ...] = DEFAULT_WORLDS  # kinds of room graphs
    tasks: tuple[Task, ...] = ("single", "all")  # `single`, `all`
    # names of `PLANNERS`, or of installed entry points; see `all_planners`
    planners: tuple[str, ...] = Field(default_factory=PLANNERS.names)
    # classes that may be searched for, None for every class; a search takes those that at least one
    # room has and another has not
    artifacts: tuple[str, ...] | None = None
    episodes: int = Field(default=200, ge=1)  # searches of every building in every world
    draws: int = Field(default=10, ge=1)  # masks of every building; the searches take turns
    strategy: str = "uniform"  # of the masks, which say what the robot saw before its search
    fraction: float = Field(default=0.5, gt=0, le=1)  # share of the objects that a mask hides
    seed: Seed = 0  # of all random draws
    # cost of a look: 0, and a robot has looked into every room that it passes, as in the paper; a
    # number; or `usual`, by the size of the room, as for a robot's decision
    look: Annotated[float, Field(ge=0, le=1e6)] | Literal["usual"] = 0.0
    chance: float = Field(default=1.0, gt=0, le=1)  # P(a look finds an instance that is there)
    start: Literal["elsewhere", "anywhere"] = "elsewhere"  # in a room without the artifact, or any
    # that search together: `nearest` and `expected-cost`, `single`, start `anywhere`, chance 1
    robots: int = Field(default=1, ge=1, le=10)

    @model_validator(mode="after")
    def _can_search(self) -> StudyRecipe:
        is_usual = (self.start, self.chance) == ("elsewhere", 1.0)
        if self.look == 0 and not is_usual:
            raise ValueError("a chance below 1 and the start `anywhere` need a `look` above 0")
        is_team = (self.start, self.chance, self.tasks) == ("anywhere", 1.0, ("single",))
        if self.robots > 1 and not (is_team and {*self.planners} <= {*TEAM}):
            raise ValueError(
                f"several robots search by {' or '.join(TEAM)}, for `single`, from anywhere, with "
                "a chance of 1"
            )
        return self

    @property
    def all_planners(self) -> tuple[str, ...]:
        """The named planners and their references: `nearest`, and `routing` for beliefs."""
        believing = self.robots == 1 and any(map(_reads_belief, self.planners))
        return tuple(dict.fromkeys((BASELINE, *self.planners, *[ROUTING] * believing)))

    @property
    def mask(self) -> MaskRecipe:
        """The recipe of the masks."""
        return MaskRecipe(**self.model_dump(include={"strategy", "fraction", "seed"}))


class SearchRequest(StudyRecipe):
    """A study of the buildings of a dataset, and what to write."""

    dataset: Path  # folder of a split dataset
    # trained models or checkpoints, as `locate_run` finds them; for a dataset of folds, one per
    # fold that is searched
    runs: tuple[Path, ...] = ()
    split: Literal["train", "val", "test", "all"] = "test"  # `all` only without runs
    scene: str | None = None  # search this building alone
    resamples: int = Field(default=1000, ge=0)  # of the buildings
    # number of the search of the first building to replay; `auto` for the first eventful one
    trace: Annotated[int, Field(ge=0)] | Literal["auto"] | None = None
    out: Path | None = None  # None for `search` in the first run or, without runs, here
    force: bool = False  # replace existing results

    @model_validator(mode="after")
    def _can_replay(self) -> SearchRequest:
        if isinstance(self.trace, int) and self.trace >= self.episodes:
            raise ValueError(f"searches of a building are numbered 0 to {self.episodes - 1}")
        return self

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        inside = self.runs and self.runs[0].is_dir()
        return self.out or (self.runs[0] / "search" if inside else Path("search"))

    @classmethod
    def read(
        cls,
        dataset: Path,
        *,
        runs: tuple[Path, ...] = (),
        worlds: Sequence[str] | None = None,
        planners: Sequence[str] | None = None,
        task: Literal["single", "all", "both"] = "both",
        artifacts: Sequence[str] = ("every",),
        mask: str = "uniform",
        **options: Any,
    ) -> SearchRequest:
        """Return the request that the words of a command mean.

        Args:
            dataset: folder of a split dataset.
            runs: trained models or checkpoints.
            worlds: as `parse_world` reads them; None for the default ones and those that the
                dataset knows.
            planners: names; None for all, or without runs for those that read no belief.
            task: when a search ends.
            artifacts: names of classes, or `every`, or `room-specific`.
            mask: the recipe's `strategy`.
            options: other fields of the request.

        Raises:
            RecipeError: if it names something unknown, or needs a run.
        """
        data = Dataset.open(dataset)
        sought: tuple[str, ...] | None = tuple(artifacts)
        if sought in (("every",), ("room-specific",)):
            sought = None if sought == ("every",) else ROOM_SPECIFIC
        require_known("class", sought or (), data.manifest.class_space.classes)
        if planners is None:
            planners = [name for name in PLANNERS if runs or not _reads_belief(name)]
        needing = [f"planner {name!r}" for name in planners if _reads_belief(name)]
        needing += ["a replay"] * (options.get("trace") is not None)
        if needing and not runs:
            raise RecipeError(f"{needing[0]} needs a belief; name a --model")
        return cls(
            dataset=dataset,
            runs=runs,
            worlds=_choose_worlds(worlds, data),
            planners=tuple(planners),
            tasks=("single", "all") if task == "both" else (task,),
            artifacts=sought,
            strategy=mask,
            **options,
        )


def _reads_belief(planner: str) -> bool:
    return PLANNERS[planner].reads == "belief"


def _choose_worlds(worlds: Sequence[str] | None, data: Dataset) -> tuple[WorldRecipe, ...]:
    if worlds is not None:
        return tuple(dict.fromkeys(map(parse_world, worlds)))
    known = data.connection_methods
    measured = (WorldRecipe(kind=kind) for kind in MEASURED if known & set(METHODS[kind]))
    return (*DEFAULT_WORLDS, *measured)


def choose_default_run(
    dataset: AnyPath, *, planners: Sequence[str] | None, split: str
) -> tuple[tuple[Path, ...], str]:
    """Return the default model for a search that names none, or none and a line that says why.

    There is none if no planner reads a belief, the buildings may have been in its training (`all`),
    none is shipped, or the dataset has other classes or folds.

    Raises:
        DatasetError: if the dataset is damaged.
        CheckpointError: if the shipped model is damaged.
    """
    if planners is not None and not any(map(_reads_belief, planners)):
        why = "no planner reads one"
    elif split == "all":
        why = "--split all may include buildings of its training"
    elif DEFAULT_MODEL not in shipped_names():
        why = f"no model {DEFAULT_MODEL!r} is shipped with this build"
    else:
        run, data = locate_run(DEFAULT_MODEL), Dataset.open(dataset)
        known, space = read_header(run).class_space, data.manifest.class_space
        if known != space:
            why = f"the model {DEFAULT_MODEL!r} predicts classes of {known}, the dataset has "
            why += f"those of {space}"
        elif "fold-0" in data.splits:
            why = f"the model {DEFAULT_MODEL!r} was not trained for these folds"
        else:
            return (run,), ""
    return (), f"without a belief: {why}"


def choose_buildings(
    request: SearchRequest, data: Dataset
) -> tuple[dict[str, Path | None], list[str]]:
    """Return building → run to ask, and notes about the choice.

    In a dataset of folds, each run answers about the fold that it was not trained on.
    """
    split, folds = request.split, "fold-0" in data.splits
    if split == "all" and request.runs:
        raise RecipeError(
            "--split all would search buildings that the model was trained on; name a split"
        )
    notes: list[str] = []
    if split == "all" or (folds and split == "test" and not request.runs):
        chosen = dict.fromkeys(data.scene_ids)
    elif request.runs:
        chosen = _choose_runs(data, request.runs, part=split)
        notes = list(_list_notes(request, data, searched=len(chosen)))
    else:
        chosen = dict.fromkeys(scenes_of(data, split))
    if request.scene is None:
        return chosen, notes
    if request.scene not in chosen:
        raise DatasetError(f"{data.path}: {request.scene!r} is not one of its {split} buildings")
    return {request.scene: chosen[request.scene]}, notes


def _choose_runs(data: Dataset, runs: Sequence[Path], *, part: Split) -> dict[str, Path | None]:
    chosen: dict[str, Path | None] = {}
    for run in runs:
        header = read_header(checkpoint_of(run))
        require_class_space(data.manifest, header.class_space, what=f"checkpoint {run}")
        fold = header.config.data.fold if "fold-0" in data.splits else None
        scenes = scenes_of(data, part, fold=fold)
        taken = sorted(set(scenes) & set(chosen))
        if taken:
            raise DatasetError(
                f"{name_run(run)}: is for the same buildings as another model, e.g. {taken[0]}; "
                "search with one model at a time, or give one run for each fold"
            )
        chosen.update(dict.fromkeys(scenes, run))
    return chosen


def _list_notes(request: SearchRequest, data: Dataset, *, searched: int) -> Iterator[str]:
    """Yield what a reader of the results must know of the runs and buildings."""
    for run in request.runs:
        if read_header(checkpoint_of(run)).dataset_sha256 != data.sha256:
            yield (
                f"{name_run(run)}: was trained on another dataset or other pairs; it may have seen "
                "these buildings"
            )
    if request.split == "train":
        yield "the runs were trained on these buildings: expect smaller savings elsewhere"
    every = len(data.scene_ids)
    is_part = request.scene is None and request.split == "test" and searched < every
    if is_part and "fold-0" in data.splits:
        yield f"{searched} of {every} buildings searched: give a --model for every fold"
