"""`bsg-search`: look for objects in simulation, with and without a belief."""

from __future__ import annotations

import json
import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import Literal, cast

import click

from bsg_cli.terminal import (
    Command,
    force_option,
    format_table,
    json_option,
    print_json,
    print_note,
    progress_bar,
    seed_option,
    worker_pool,
    workers_option,
)
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.files import write_bytes
from bsg_models.inputs.graphs import Buildings, open_dataset
from bsg_models.rendering.explorer import write_explorer
from bsg_models.rendering.figures import plot_savings
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.search.planners import PLANNERS
from bsg_models.search.room_graphs import DEFAULT_WORLDS, WorldRecipe, parse_world
from bsg_models.studies.replay import TraceRequest, trace_search
from bsg_models.studies.savings import (
    LEAST_BUILDINGS,
    Interval,
    Saving,
    WorldResult,
    saving_of_buildings,
    summarise,
)
from bsg_models.studies.search_cases import BASELINE, StudyRecipe
from bsg_models.studies.search_files import encode_study, write_searches
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


@click.command(cls=Command)
@click.option(
    "--run",
    "runs",
    type=click.Path(path_type=Path),
    multiple=True,
    help="Of a trained model; of a dataset of folds, one for each fold that is searched.",
)
@click.option("--data", type=click.Path(path_type=Path), required=True, help="Dataset, split.")
@click.option(
    "--split",
    type=click.Choice(["train", "val", "test", "all"]),
    default="test",
    show_default=True,
    help="Whose buildings are searched; `all` only without --run.",
)
@click.option(
    "--planners",
    help=f"Some of {', '.join(PLANNERS)}.  [default: all; without a RUN those without a belief]",
)
@click.option(
    "--worlds",
    help="Kinds of room graphs, KIND or KIND:LOW-HIGH: star, complete, complete-paths, tree, "
    "tree-plus with random costs, layout or geometry with distances.  [default: "
    f"{','.join(world.name for world in DEFAULT_WORLDS)}, and layout or geometry where known]",
)
@click.option(
    "--task",
    type=click.Choice(["single", "all", "both"]),
    default="both",
    show_default=True,
    help="Find one instance of each class, or all.",
)
@click.option(
    "--artifacts",
    default="every",
    show_default=True,
    help="Classes to search for, one a search: `every`, `room-specific`, or names with commas.",
)
@click.option(
    "--at-once",
    type=click.IntRange(min=1),
    default=1,
    show_default=True,
    help="Classes that one search looks for.",
)
@click.option(
    "--episodes",
    type=click.IntRange(min=1),
    default=200,
    show_default=True,
    help="Searches of every building in every world.",
)
@click.option(
    "--masks",
    type=click.IntRange(min=1),
    default=10,
    show_default=True,
    help="Masks of every building, which the searches take in turn.",
)
@click.option(
    "--fraction",
    type=click.FloatRange(min=0, min_open=True, max=1),
    default=0.5,
    show_default=True,
    help="Share of the objects that a mask hides; the artifact is hidden wholly.",
)
@click.option(
    "--stop",
    "stops",
    help="Of `all`: let the robot stop by itself once it believes that anything is left with at "
    "most this probability; several with commas.",
)
@click.option(
    "--truth",
    type=click.Choice(["real", "posterior"]),
    default="real",
    show_default=True,
    help="Where the artifact is; `posterior` puts it where the RUN believes it at the start.",
)
@click.option(
    "--resamples",
    type=click.IntRange(min=0),
    default=1000,
    show_default=True,
    help="Bootstrap resamples of the buildings; 0 for no intervals.",
)
@click.option(
    "--trace",
    type=click.IntRange(min=0),
    metavar="N",
    help="Replay search N of the first building, in the first world, room by room, as a page.",
)
@click.option("--scene", help="Search this building alone.")
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder of the results.  [default: search in the first RUN, or search]",
)
@workers_option
@seed_option
@force_option
@json_option
@click.version_option(package_name="belief-scene-graphs", prog_name="bsg-search")
def main(
    runs: tuple[Path, ...],
    data: Path,
    split: Literal["train", "val", "test", "all"],
    planners: str | None,
    worlds: str | None,
    task: Literal["single", "all", "both"],
    artifacts: str,
    at_once: int,
    episodes: int,
    masks: int,
    fraction: float,
    stops: str | None,
    truth: Literal["real", "posterior"],
    resamples: int,
    trace: int | None,
    scene: str | None,
    out: Path | None,
    workers: int,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    """Search buildings for objects with every planner, and say what each saves.

    Every planner meets the same searches; what it saves is measured beside `nearest`, which goes to
    the nearest unexplored room. docs/search.md says what each planner and world is.

    \b
    Example:
      bsg-search --run run --data dataset
      bsg-search --run run --data dataset --worlds star:1-10 --artifacts stove,bed --trace 0
    """
    out = out or (runs[0] / "search" if runs and runs[0].is_dir() else Path("search"))
    report = out / REPORT
    if report.exists() and not force:
        raise DatasetError(
            f"{report}: is there already; --force replaces it, --out puts it elsewhere"
        )
    _make_folder(out)
    opened = open_dataset(data)
    classes = opened.manifest.class_map.classes
    chosen, notes = _choose_buildings(opened, runs, split, scene)
    recipe = StudyRecipe(
        worlds=_choose_worlds(worlds, data),
        tasks=("single", "all") if task == "both" else (task,),
        planners=_choose_planners(planners, believed=bool(runs)),
        artifacts=_choose_artifacts(artifacts, classes),
        at_once=at_once,
        episodes=episodes,
        masks=masks,
        fraction=fraction,
        stops=_read_stops(stops, task),
        truth=truth,
        seed=seed,
    )
    if trace is not None and trace >= episodes:
        raise click.UsageError(f"--trace {trace}: a building has {episodes} searches, from 0")
    if trace is not None and truth == "posterior":
        raise click.UsageError("--trace replays searches for what is really there")
    if not runs and (trace is not None or recipe.stops or truth == "posterior"):
        raise click.UsageError("--trace, --stop and --truth posterior need a --run")
    with worker_pool(workers) as executor, progress_bar("search", unit="building") as progress:
        study = study_search(data, chosen, recipe, executor=executor, progress=progress)
    results = summarise(study, resamples=resamples)
    model = ", ".join(dict.fromkeys(_family(run) for run in runs)) or None
    written = {"every search": out / TABLE}
    write_searches(study, classes, out / TABLE)
    if _draw(study, out / FIGURE, model):
        written["box plot over buildings"] = out / FIGURE
    if trace is not None:
        which = _write_trace(data, chosen, study, trace, out / TRACE)
        written[which] = out / TRACE
    facts = {
        "dataset": str(data),
        "runs": [str(run) for run in runs],
        "model": model,
        "split": None if split == "all" else split,
        "resamples": resamples,
    }
    summary = encode_study(study, results, classes=classes, facts=facts)
    write_bytes(report, (json.dumps(summary, indent=1) + "\n").encode())  # last: it means finished
    for note in [*notes, *_say_left_out(study)]:
        print_note(note)
    if as_json:
        print_json(summary)
        return
    names = [classes[c] for c in recipe.artifacts or range(len(classes))]
    sought = f"any of {len(names)} classes" if len(names) > 12 else ", ".join(names)
    click.echo(f"artifacts: {sought}; {recipe.at_once} at once; beliefs of {model or 'nobody'}")
    if truth == "posterior":
        click.echo(
            "artifacts were put where the model believes them: its belief is right, and only the "
            "oracle knows better"
        )
    if resamples > 1 and any(one.buildings < LEAST_BUILDINGS for one in results):
        print_note(f"intervals are over buildings, and need {LEAST_BUILDINGS} of them")
    for one in results:
        click.echo("\n" + format_result(one))
    click.echo(f"\nall of it: {report}; " + "; ".join(f"{k}: {v}" for k, v in written.items()))


def _choose_buildings(
    opened: Buildings,
    runs: Sequence[Path],
    split: Literal["train", "val", "test", "all"],
    scene: str | None,
) -> tuple[dict[str, Path | None], list[str]]:
    """Return which run is asked about which building, and notes."""
    chosen: dict[str, Path | None]
    notes: list[str] = []
    if runs and split == "all":
        raise click.UsageError("--split all would search buildings that the RUN was trained on")
    folds = "fold-0" in opened.splits
    if runs and split != "all":
        chosen, notes = choose_runs(opened.path, runs, part=split)
        if split == "train":
            notes.append(
                "these buildings trained the runs: what is saved here is not what to expect"
            )
        if folds and split == "test" and scene is None and len(chosen) < len(opened.cells):
            notes.append(
                f"{len(chosen)} of {len(opened.cells)} buildings: give a --run for every fold"
            )
    elif folds and split not in ("all", "test"):
        raise click.UsageError(f"--split {split} of a dataset of folds needs a --run")
    elif split == "all" or folds:
        chosen = dict.fromkeys(opened.cells)
    else:
        chosen = dict.fromkeys(opened.scenes_of(split))
    if scene is not None:
        if scene not in chosen:
            raise DatasetError(f"{opened.path}: {scene!r} is none of its {split} buildings")
        chosen = {scene: chosen[scene]}
    return chosen, notes


def _family(run: Path) -> str:
    return read_header(checkpoint_of(run)).config.model.family


def _make_folder(out: Path) -> None:
    """Make the folder of the results before anything is searched."""
    try:
        out.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=out):
            pass
    except OSError as error:
        raise DatasetError(f"{out}: cannot be written to ({error.strerror})") from error


def _choose_worlds(text: str | None, data: Path) -> tuple[WorldRecipe, ...]:
    if text is None:
        return (*DEFAULT_WORLDS, *known_worlds(data))
    return tuple(dict.fromkeys(parse_world(part) for part in text.split(",")))


def _choose_planners(text: str | None, *, believed: bool) -> tuple[str, ...]:
    if text is None:
        return tuple(n for n, p in PLANNERS.items() if believed or p.reads != "belief")
    names = tuple(dict.fromkeys(name.strip() for name in text.split(",")))
    unknown = [name for name in names if name not in PLANNERS]
    if unknown:
        raise click.UsageError(f"--planners: {unknown[0]!r} is none of {', '.join(PLANNERS)}")
    needing = [name for name in names if PLANNERS[name].reads == "belief"]
    if needing and not believed:
        raise click.UsageError(f"--planners: {needing[0]} needs a belief; name a --run")
    return names


def _choose_artifacts(text: str, classes: Sequence[str]) -> tuple[int, ...] | None:
    if text == "every":
        return None
    wanted = ROOM_SPECIFIC if text == "room-specific" else [n.strip() for n in text.split(",")]
    unknown = [name for name in wanted if name not in classes]
    if unknown:
        raise RecipeError(
            f"--artifacts: {unknown[0]!r} is no class; known are {', '.join(classes)}"
        )
    return tuple(sorted({classes.index(name) for name in wanted}))


def _read_stops(text: str | None, task: str) -> tuple[float, ...]:
    if text is None:
        return ()
    if task == "single":
        raise click.UsageError("--stop is of the task all")
    try:
        stops = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise click.UsageError(f"--stop: {text!r} are no numbers") from error
    if not all(0 < stop < 1 for stop in stops):
        raise click.UsageError(f"--stop: probabilities between 0 and 1, found {text}")
    return stops


def _say_left_out(study: Study) -> list[str]:
    return [
        f"{world}: {number} of {len(study.scenes)} buildings left out: {reason}"
        for world, reasons in study.left_out.items()
        for reason, number in reasons.items()
    ]


def _draw(study: Study, path: Path, model: str | None) -> bool:
    """Draw what planners save, if there are any beside `nearest`; say whether."""
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


def _write_trace(
    data: Path, chosen: dict[str, Path | None], study: Study, number: int, path: Path
) -> str:
    """Replay search `number` of the first building and world of a study; say which that is."""
    first = study.searches[0]
    world = next(one for one in study.recipe.worlds if one.name == first.world)
    names = [name for name in study.recipe.planners if PLANNERS[name].reads == "belief"]
    planner = "expected-cost" if "expected-cost" in names else (names or study.recipe.planners)[0]
    request = TraceRequest(first.scene_id, number, world, study.recipe.tasks[0], planner)
    run = cast(Path, chosen[first.scene_id])  # --trace needs a --run
    write_explorer(trace_search(data, run, study.recipe, request), path)
    return f"search {number} of {first.scene_id} in {world.name}, {request.task}, by {planner}"


def format_result(one: WorldResult) -> str:
    """Return the results of a world and task as text."""
    line = f"{one.world}, {one.task}: {one.searches:,} searches of {one.buildings} buildings"
    if not math.isnan(one.ranked_first):
        line += (
            f"; the likeliest room holds one in {one.ranked_first:.0%}, a random one in "
            f"{one.chance:.0%}"
        )
    header = (
        "planner",
        "saved, %",
        "beyond routing",
        "of the oracle's",
        "mean",
        "median",
        "wins",
        "ties",
        "losses",
        "cost",
        "rooms",
    )
    rows = [_row(name, saving) for name, saving in one.savings.items()]
    lines = [line, format_table(rows, header=header)]
    if one.stops:
        lines.append("expected-cost stops by itself, beside entering every room, nearest first:")
        stop_rows = [
            (
                f"at {name}",
                _percent(stop.saved),
                _percent(stop.missed),
                _percent(stop.incomplete),
                f"{stop.entered:.1f}",
            )
            for name, stop in one.stops.items()
        ]
        names = ("anything left", "saved, %", "instances missed", "searches that miss any", "rooms")
        lines.append(format_table(stop_rows, header=names))
    return "\n".join(lines)


def _row(name: str, saving: Saving) -> tuple[object, ...]:
    return (
        name,
        _percent(saving.saved),
        _percent(saving.beyond_routing, interval=False),
        _percent(saving.of_oracle, interval=False),
        f"{100 * saving.mean:.1f}",
        f"{100 * saving.median:.1f}",
        saving.wins,
        saving.ties,
        saving.losses,
        f"{saving.cost:.2f}",
        f"{saving.entered:.1f}",
    )


def _percent(value: Interval, *, interval: bool = True) -> str:
    if math.isnan(value.value):
        return "-"
    text = f"{100 * value.value:.1f}"
    if not interval or math.isnan(value.low):
        return text
    return f"{text} ({100 * value.low:.1f} to {100 * value.high:.1f})"
