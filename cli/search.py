"""`bsg-search`: look for objects in simulation, with and without a belief."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import bsg_models
from bsg_cli.choices import DEFAULT_WORLDS, PLANNERS, WORLDS, require_known
from bsg_cli.completion import classes_of_dataset, complete_list
from bsg_cli.options import (
    PATH,
    data_option,
    force_option,
    json_option,
    mask_options,
    model_option,
    out_option,
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


class SearchNumber(click.ParamType[int | str]):
    """The number of a search, from 0, or `auto` for one that is worth watching."""

    name = "search"

    def convert(
        self, value: Any, param: click.Parameter | None, ctx: click.Context | None
    ) -> int | str:
        """Return the number or `auto`, or refuse it."""
        if value == "auto":
            return "auto"
        return int(click.IntRange(min=0).convert(value, param, ctx))


@click.command("bsg-search", cls=Command)
@model_option(
    "Of which the belief is; of a dataset of folds, one run for each fold that is searched.  "
    "[default: universal, where it fits]",
    multiple=True,
)
@click.option("--no-model", is_flag=True, help="Search without a belief.")
@data_option("Dataset, split.")
@split_option(
    "Whose buildings are searched; `all` only without a model.", default="test", more=("all",)
)
@click.option(
    "--planners",
    shell_complete=complete_list(lambda ctx: PLANNERS),
    help=f"Some of {', '.join(PLANNERS)}.  [default: all; without a model those without a belief]",
)
@click.option(
    "--worlds",
    shell_complete=complete_list(lambda ctx: WORLDS),
    help=f"Kinds of room graphs, KIND or KIND:LOW-HIGH: {', '.join(WORLDS[:5])} with random costs, "
    f"{' or '.join(WORLDS[5:])} with distances.  [default: {','.join(DEFAULT_WORLDS)}, and "
    f"{' or '.join(WORLDS[5:])} where known]",
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
    shell_complete=complete_list(lambda ctx: ("every", "room-specific", *classes_of_dataset(ctx))),
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
@mask_options(
    "What the robot saw before it searches.",
    "Share of the objects that a mask hides; the artifact is hidden wholly.",
    min_open=True,
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
    help="Where the artifact is; `posterior` puts it where the model believes it at the start.",
)
@resamples_option(1000)
@click.option(
    "--trace",
    type=SearchNumber(),
    metavar="[N]",
    is_flag=False,
    flag_value="auto",
    help="Replay one search, room by room, beside the same by `nearest`, as a page: search N of "
    "the first building; without N, one that is worth watching.",
)
@click.option(
    "--animation",
    type=PATH,
    metavar="FILE.gif|FILE.png",
    help="Draw the replay as a moving picture, too, a GIF or an animated PNG.",
)
@click.option("--scene", help="Search this building alone.")
@out_option("Folder of the results.  [default: search in the first run, or search]")
@click.option("--all-columns", is_flag=True, help="Print a longer table for each task.")
@workers_option
@seed_option()
@force_option
@json_option
def main(
    model: tuple[str, ...],
    run: tuple[Path, ...],
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

    Every planner meets the same searches; what it saves is measured beside `nearest`, which goes to
    the nearest unexplored room. docs/search.md says what each planner and world is.

    \b
    Example:
      bsg-search --data dataset
      bsg-search --model run --data dataset --worlds star:1-10 --artifacts stove,bed --trace
    """
    lists = {
        "planners": split_names(planners, option="--planners"),
        "worlds": split_names(worlds, option="--worlds"),
        "artifacts": split_names(artifacts, option="--artifacts"),
    }
    require_known("planner", lists["planners"] or (), PLANNERS)
    kinds = [world.partition(":")[0] for world in lists["worlds"] or ()]
    require_known("world", kinds, WORLDS)
    named: list[Path | str] = [*model, *run]
    runs = tuple(map(bsg_models.locate_run, named))
    if no_model and runs:
        raise click.UsageError("--no-model leaves no use for a --model")
    if not runs and not no_model:
        runs, note = bsg_models.choose_default_run(
            options["dataset"], planners=lists["planners"], split=options["split"]
        )
        print_note(note)
    request = bsg_models.SearchRequest.model_validate(
        {**options, **lists, "runs": runs, "stops": read_stops(stops)}
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
    print_text(
        f"artifacts: {sought}; {request.at_once} at once; beliefs of {report.model or 'nobody'}"
    )
    if request.truth == "posterior":
        print_text(
            "artifacts were put where the model believes them: its belief is right, and only the "
            "oracle knows better"
        )
    for table in format_results(report.results, all_columns=all_columns):
        print_text("\n" + table)
    written = "; ".join(f"{what}: {path}" for what, path in report.written.items())
    print_text(f"\nall of it: {report.report}; {written}")


def read_stops(text: str | None) -> tuple[float, ...]:
    """Return the probabilities of `--stop`."""
    if text is None:
        return ()
    try:
        stops = tuple(float(part) for part in text.split(","))
    except ValueError as error:
        raise click.UsageError(f"--stop: {text!r}: expected numbers") from error
    if not all(0 < stop < 1 for stop in stops):
        raise click.UsageError(f"--stop: probabilities between 0 and 1, found {text}")
    return stops
