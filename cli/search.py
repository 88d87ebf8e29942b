"""`bsg-search`: search for objects in simulation, with and without a belief."""

from __future__ import annotations

from typing import Any

import click

import bsg_models
from bsg_cli.choices import (
    DEFAULT_WORLDS,
    PLANNERS,
    WORLDS,
    classes_of_dataset,
    complete_list,
    require_known,
)
from bsg_cli.options import (
    PATH,
    choice_option,
    data_option,
    force_option,
    json_option,
    mask_options,
    model_option,
    number_option,
    out_option,
    rerun_option,
    resamples_option,
    seed_option,
    split_names,
    split_option,
    workers_option,
)
from bsg_cli.search_tables import format_results
from bsg_cli.terminal import (
    Command,
    Workers,
    print_json,
    print_note,
    print_text,
    progress_bar,
    worker_pool,
)


def _read_number(value: str) -> int | str:
    """Return the number of a search, from 0, or `auto` for an instructive one."""
    return "auto" if value == "auto" else int(click.IntRange(min=0)(value))


@click.command("bsg-search", cls=Command)
@model_option(
    "Model of the belief. For a dataset of folds, give one run per searched fold.  "
    "[default: universal, if it fits]",
    multiple=True,
)
@click.option("--no-model", is_flag=True, help="Search without a belief.")
@data_option("Dataset with a split.")
@split_option("Split to search in; `all` only without a model.", default="test", more=("all",))
@click.option(
    "--planners",
    shell_complete=complete_list(lambda ctx: PLANNERS),
    help=f"Planners, with commas: {', '.join(PLANNERS)}.  [default: all; without a model, all that "
    "need no belief]",
)
@click.option(
    "--worlds",
    shell_complete=complete_list(lambda ctx: WORLDS),
    help=f"Room graphs, with commas, each KIND or KIND:LOW-HIGH. Random costs: "
    f"{', '.join(WORLDS[:5])}. Distances as costs: {', '.join(WORLDS[5:])}.  "
    f"[default: {','.join(DEFAULT_WORLDS)}, and {' or '.join(WORLDS[5:])} if the dataset has it]",
)
@choice_option(
    "--task",
    ["single", "all", "both"],
    "Find one instance of each class, find all instances, or do both tasks.",
    default="both",
)
@click.option(
    "--artifacts",
    shell_complete=complete_list(lambda ctx: ("every", "room-specific", *classes_of_dataset(ctx))),
    default="every",
    show_default=True,
    help="Classes to search for: `every`, `room-specific`, or names with commas.",
)
@number_option("--at-once", "Number of classes per search.", default=1)
@number_option("--episodes", "Searches per building and world.", default=200)
@number_option("--masks", "Masks per building; the searches use them in turn.", default=10)
@mask_options(
    "What the robot has seen before the search.",
    "Share of the objects to hide; the artifact is always hidden.",
    min_open=True,
)
@click.option(
    "--stop",
    "stops",
    help="For the task `all`: the robot stops once it believes with at most this probability that "
    "anything is left. Several values with commas.",
)
@choice_option(
    "--truth",
    ["real", "posterior"],
    "Where the artifacts are; `posterior` draws their places from the model's first belief.",
    default="real",
)
@resamples_option(1000)
@click.option(
    "--trace",
    type=_read_number,
    metavar="[N]",
    is_flag=False,
    flag_value="auto",
    help="Write one search as a page, beside the same search by `nearest`: search N of the first "
    "building; without N, an instructive one.",
)
@click.option(
    "--animation",
    type=PATH,
    metavar="FILE.gif|FILE.png",
    help="Also draw the replay as an animation: GIF or animated PNG.",
)
@rerun_option("Also write the replay as a recording for the Rerun viewer, one step per room.")
@click.option("--scene", help="Search only this building.")
@out_option("Folder of the results.  [default: search in the first run, or search]")
@click.option("--all-columns", is_flag=True, help="Print a longer table for each task.")
@workers_option
@seed_option()
@force_option
@json_option
def main(
    model: tuple[str, ...],
    no_model: bool,
    planners: str | None,
    worlds: str | None,
    artifacts: str,
    stops: str | None,
    workers: Workers,
    all_columns: bool,
    as_json: bool,
    **options: Any,
) -> None:
    """Search buildings for objects with every planner, and say what each saves.

    All planners do the same searches. Savings are relative to `nearest`, which goes to the nearest
    unexplored room. docs/search.md describes planners and worlds.

    \b
    Example:
      bsg-search --data dataset
      bsg-search --model run --data dataset --worlds star:1-10 --artifacts stove,bed --trace
    """
    chosen = split_names(planners, option="--planners")
    graphs = split_names(worlds, option="--worlds")
    require_known("planner", chosen or (), PLANNERS)
    require_known("world", [world.partition(":")[0] for world in graphs or ()], WORLDS)
    runs = tuple(map(bsg_models.locate_run, model))
    if no_model and runs:
        raise click.UsageError("--no-model excludes --model; give one of them")
    if not runs and not no_model:
        runs, note = bsg_models.choose_default_run(
            options["dataset"], planners=chosen, split=options["split"]
        )
        print_note(note)
    request = bsg_models.SearchRequest.read(
        options.pop("dataset"),
        runs=runs,
        planners=chosen,
        worlds=graphs,
        artifacts=split_names(artifacts, option="--artifacts") or (),
        stops=_read_stops(stops),
        **options,
    )
    pool = worker_pool(workers, reads=[request.dataset, *request.runs])
    with pool as executor, progress_bar("search", unit="building") as progress:
        report = bsg_models.report_search(request, executor=executor, progress=progress)
    for note in report.notes:
        print_note(note)
    if as_json:
        print_json(report.summary)
        return
    number = len(report.sought)
    sought = f"any of {number} classes" if number > 12 else ", ".join(report.sought)
    print_text(f"artifacts: {sought}; {request.at_once} at once; model: {report.model or 'none'}")
    if request.truth == "posterior":
        print_text(
            "artifact places were drawn from the model's belief, so the belief is right; only the "
            "oracle knows better"
        )
    for table in format_results(report.results, all_columns=all_columns):
        print_text("\n" + table)
    written = "; ".join(f"{what}: {path}" for what, path in report.written.items())
    print_text(f"\nall results: {report.report}; {written}")


def _read_stops(text: str | None) -> tuple[float, ...]:
    """Return the probabilities of `--stop`."""
    if text is None:
        return ()
    try:
        stops = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise click.UsageError(
            f"--stop: expected numbers with commas between them, found {text!r}"
        ) from error
    if not all(0 < stop < 1 for stop in stops):
        raise click.UsageError(f"--stop: expected probabilities between 0 and 1, found {text}")
    return stops
