"""Run a search study as a request asks, and write its files.

OUT/search.json         every result
OUT/searches.parquet    one row per search
OUT/savings.png         a box plot over buildings
OUT/trace.html          one search, room by room, beside the same search by `nearest`
OUT/SHA256SUMS          the seal of all files, written last: its presence means finished
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import Executor
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.figure_file import noting_failures
from bsg_data.files import AnyPath, encode_json, write_bytes
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.recipes import Record, Share
from bsg_data.registry import require_known
from bsg_data.results import refuse_file, write_results
from bsg_models.evaluation.bootstrap import LEAST_BUILDINGS
from bsg_models.inputs.folds import scenes_of
from bsg_models.rendering.animation import require_suffix, write_animation
from bsg_models.rendering.figures import plot_savings
from bsg_models.rendering.replay import write_replay
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.found_model import locate_run
from bsg_models.runs.model_card import describe_model
from bsg_models.runs.run_folder import checkpoint_of, refuse_run
from bsg_models.runs.shipped import DEFAULT_MODEL, name_run, shipped_names
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.room_graphs import DEFAULT_WORLDS, WorldRecipe, parse_world
from bsg_models.studies.replay import choose_replay, replay_search
from bsg_models.studies.savings import (
    WorldResult,
    encode_study,
    saving_of_buildings,
    summarise,
    write_searches,
)
from bsg_models.studies.search_cases import BASELINE, StudyRecipe
from bsg_models.studies.search_steps import KeepRequest
from bsg_models.studies.search_study import Study, choose_runs, known_worlds, study_search

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
REPORT, TABLE, FIGURE, TRACE = "search.json", "searches.parquet", "savings.png", "trace.html"


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
    # `search_steps`
    trace: Annotated[int, Field(ge=0)] | Literal["auto"] | None = None
    animation: Path | None = None  # file for the replay, in the format of its suffix
    out: Path | None = None  # None for `search` in the first run or, without runs, here
    force: bool = False  # replace existing results

    @property
    def folder(self) -> Path:
        """Folder of the results."""
        inside = self.runs and self.runs[0].is_dir()
        return self.out or (self.runs[0] / "search" if inside else Path("search"))


class SearchReport(NamedTuple):
    """A search study and its files."""

    study: Study  # all searches
    results: list[WorldResult]  # of every world and task
    summary: dict[str, Any]  # the study as JSON
    model: str | None  # whose beliefs were used; None for none
    sought: tuple[str, ...]  # names of the classes that were searched for
    report: Path  # file of the summary
    written: dict[str, Path]  # other content → file
    notes: tuple[str, ...]  # warnings that a reader of the results needs


def report_search(
    request: SearchRequest,
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> SearchReport:
    """Search buildings with every planner, and write the results.

    Args:
        request: which buildings, and how.
        executor: works on the buildings; None works in this process.
        progress: called with (buildings done, in all).

    Raises:
        DatasetError: if results already exist or cannot be written, or no building can be searched.
        RecipeError: if the request names something unknown, or needs a run.
        CheckpointError: if a run cannot be loaded.
    """
    report = request.folder / REPORT
    if request.animation is not None:
        refuse_file(request.animation, force=request.force)
    with write_results(
        request.folder,
        report=REPORT,
        force=request.force,
        refuse=lambda: refuse_run(request.folder),
    ) as staged:
        made = _search_into(staged, request, executor=executor, progress=progress)
    written = {
        what: request.folder / path.name if path.parent == staged else path
        for what, path in made.written.items()
    }
    return made._replace(report=report, written=written)


def _search_into(
    staged: Path,
    request: SearchRequest,
    *,
    executor: Executor | None,
    progress: Callable[[int, int], None] | None,
) -> SearchReport:
    """Search, and write all files into a folder."""
    runs = request.runs
    opened = Dataset.open(request.dataset)
    classes = opened.manifest.class_space.classes
    chosen, notes = _choose_buildings(opened, runs, split=request.split, scene=request.scene)
    recipe = make_recipe(request, classes)
    sums = [hash_file(checkpoint_of(run)) for run in runs]
    keep = None if request.trace is None else _choose_trace(recipe, request.trace)
    study = study_search(
        request.dataset, chosen, recipe, keep=keep, executor=executor, progress=progress
    )
    results = summarise(study, resamples=request.resamples)
    model = (
        ", ".join(dict.fromkeys(read_header(checkpoint_of(run)).config.name for run in runs))
        or None
    )
    written = {"every search": staged / TABLE}
    write_searches(study, classes, staged / TABLE)
    with noting_failures(notes):
        if _plot(study, staged / FIGURE, model):
            written["box plot over buildings"] = staged / FIGURE
    if keep is not None:
        written |= _write_replay(
            request, study, results, model, page=staged / TRACE, picture=request.animation
        )
    facts = {
        "dataset": str(request.dataset),
        "runs": [name_run(run) for run in runs],
        "checkpoints_sha256": sums,
        "model": model,
        "split": None if request.split == "all" else request.split,
        "resamples": request.resamples,
    }
    summary = encode_study(study, results, classes=classes, facts=facts)
    write_bytes(staged / REPORT, (encode_json(summary, indent=1) + "\n").encode())
    notes += _note_left_out(study)
    if request.resamples > 1 and any(one.buildings < LEAST_BUILDINGS for one in results):
        notes.append(f"intervals are over buildings, and need {LEAST_BUILDINGS} of them")
    sought = tuple(classes[c] for c in recipe.artifacts or range(len(classes)))
    return SearchReport(
        study, results, summary, model, sought, staged / REPORT, written, tuple(notes)
    )


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
    dataset = Path(dataset)
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
    header = read_header(run)
    if header.class_space != data.manifest.class_space:
        return (), (
            f"without a belief: the model {DEFAULT_MODEL!r} predicts classes of "
            f"{header.class_space}, the dataset has those of {data.manifest.class_space}"
        )
    if "fold-0" in data.splits:
        return (), f"without a belief: the model {DEFAULT_MODEL!r} was not trained for these folds"
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
    trace, posterior = request.trace, request.truth == "posterior"
    if request.stops and request.task == "single":
        raise RecipeError("--stop needs --task all or both")
    if isinstance(trace, int) and trace >= request.episodes:
        raise RecipeError(
            f"--trace {trace}: a building has {request.episodes} searches, numbered from 0"
        )
    if request.animation is not None:
        require_suffix(request.animation)
        if trace is None:
            raise RecipeError("--animation shows a replay: add --trace")
    if trace is not None and posterior:
        raise RecipeError("--trace replays searches for what is really there (--truth real)")
    if not request.runs and (trace is not None or request.stops or posterior):
        raise RecipeError("--trace, --stop and --truth posterior need a --model")
    return recipe


def _choose_buildings(
    opened: Dataset,
    runs: Sequence[Path],
    *,
    split: Literal["train", "val", "test", "all"],
    scene: str | None,
) -> tuple[dict[str, Path | None], list[str]]:
    """Return building → run to ask, and notes about the choice."""
    chosen: dict[str, Path | None]
    notes: list[str] = []
    folds = "fold-0" in opened.splits
    if runs and split == "all":
        raise RecipeError(
            "--split all would search buildings that the RUN was trained on; name a split"
        )
    if runs and split != "all":
        chosen, notes = choose_runs(opened.path, runs, part=split)
        if split == "train":
            notes.append(
                "the runs were trained on these buildings: expect smaller savings elsewhere"
            )
        if folds and split == "test" and scene is None and len(chosen) < len(opened.scene_ids):
            notes.append(
                f"{len(chosen)} of {len(opened.scene_ids)} buildings searched: give a --run for "
                "every fold"
            )
    elif folds and split not in ("all", "test"):
        raise RecipeError(f"--split {split} of a dataset of folds needs a --run")
    elif split == "all" or folds:
        chosen = dict.fromkeys(opened.scene_ids)
    else:
        chosen = dict.fromkeys(scenes_of(opened, split))
    if scene is not None:
        if scene not in chosen:
            raise DatasetError(f"{opened.path}: {scene!r} is not one of its {split} buildings")
        chosen = {scene: chosen[scene]}
    return chosen, notes


def _choose_worlds(request: SearchRequest) -> tuple[WorldRecipe, ...]:
    if request.worlds is None:
        return (*DEFAULT_WORLDS, *known_worlds(request.dataset))
    return tuple(dict.fromkeys(parse_world(text) for text in request.worlds))


def _choose_planners(request: SearchRequest) -> tuple[str, ...]:
    believed = bool(request.runs)
    if request.planners is None:
        return tuple(n for n in PLANNERS if believed or PLANNERS[n].reads != "belief")
    PLANNERS.require(request.planners)
    needing = [name for name in request.planners if PLANNERS[name].reads == "belief"]
    if needing and not believed:
        raise RecipeError(f"planner {needing[0]!r} needs a belief; name a --model")
    return request.planners


def _choose_artifacts(names: tuple[str, ...], classes: Sequence[str]) -> tuple[int, ...] | None:
    if names == ("every",):
        return None
    wanted = ROOM_SPECIFIC if names == ("room-specific",) else names
    require_known("class", wanted, classes)
    return tuple(sorted({classes.index(name) for name in wanted}))


def _note_left_out(study: Study) -> list[str]:
    return [
        f"{world}: {number} of {len(study.scenes)} buildings left out: {reason}"
        for world, reasons in study.left_out.items()
        for reason, number in reasons.items()
    ]


def _plot(study: Study, path: Path, model: str | None) -> bool:
    """Plot what planners save; return False if there is no planner besides `nearest`."""
    shown = [name for name in study.recipe.all_planners if name != BASELINE]
    if not shown:
        return False
    panels = {}
    for world in dict.fromkeys(one.world for one in study.searches):
        searches = [one for one in study.searches if one.world == world]
        for task in study.recipe.tasks:
            panels[f"{world}, {task}, {len(searches)} buildings"] = {
                name: saving_of_buildings(searches, task, name) for name in shown
            }
    title = f"Object search with the beliefs of {model}" if model else "Object search"
    plot_savings(panels, path, title=title, whole="oracle")
    return True


def _choose_trace(recipe: StudyRecipe, trace: int | Literal["auto"]) -> KeepRequest:
    """Return the request that keeps searches by the planner that uses beliefs most."""
    names = [name for name in recipe.planners if PLANNERS[name].reads == "belief"]
    planner = "expected-cost" if "expected-cost" in names else (names or recipe.planners)[0]
    episode = None if trace == "auto" else trace
    return KeepRequest(episode, recipe.tasks[0], planner)


def _write_replay(
    request: SearchRequest,
    study: Study,
    results: list[WorldResult],
    model: str | None,
    *,
    page: Path,
    picture: Path | None,
) -> dict[str, Path]:
    """Write a kept search as a page and, if asked, as an animation; return content → file."""
    named = request.trace != "auto"
    kept = choose_replay(study, results, named=named)
    replay = replay_search(request.dataset, study, results, kept, model=model, named=named)
    write_replay(replay, page)
    which = (
        f"search {kept.episode} of {kept.scene_id} in {kept.world}, {kept.task}, by {kept.planner}"
    )
    if picture is None:
        return {which: page}
    write_animation(replay, picture)
    return {which: page, "the same as a picture": picture}
