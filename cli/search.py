"""`bsg-search`: search for objects in simulation, with and without a belief."""

from __future__ import annotations

from pathlib import Path
from typing import Any, get_args

import click

from bsg_cli.choices import classes_of_dataset, complete_list
from bsg_cli.options import (
    choice_option,
    dataset_argument,
    force_option,
    json_option,
    mask_options,
    model_option,
    number_option,
    out_option,
    seed_option,
    split_names,
    split_option,
    workers_option,
)
from bsg_cli.terminal import (
    Command,
    print_json,
    print_note,
    print_text,
    progress_bar,
    worker_pool,
)
from bsg_data.registry import require_known
from bsg_data.tables import format_text
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.room_graphs import DEFAULT_WORLDS, WorldKind

_WORLDS: tuple[str, ...] = get_args(WorldKind)
_USUAL = ",".join(world.name for world in DEFAULT_WORLDS)


def _read_number(value: str) -> int | str:
    """Return the number of a search, from 0, or `auto` for the first eventful one."""
    return "auto" if value == "auto" else int(click.IntRange(min=0)(value))


def _read_look(value: str) -> float | str:
    """Return the cost of a look, or `usual`."""
    return "usual" if value == "usual" else float(click.FloatRange(min=0)(value))


@click.command("bsg-search", cls=Command)
@dataset_argument
@model_option(
    "Model of the belief, or none. For a dataset of folds, give one run per searched fold.  "
    "[default: universal, if it fits]",
    multiple=True,
)
@split_option("Split to search in; `all` only without a model.", default="test", more=("all",))
@click.option(
    "--planners",
    shell_complete=complete_list(lambda ctx: PLANNERS),
    help=f"Planners, with commas: {', '.join(PLANNERS)}.  [default: all; without a model, all that "
    "need no belief]",
)
@click.option(
    "--worlds",
    shell_complete=complete_list(lambda ctx: _WORLDS),
    help=f"Room graphs, with commas, each KIND or KIND:LOW-HIGH. Random costs: "
    f"{', '.join(_WORLDS[:3])}. Distances as costs: {', '.join(_WORLDS[3:])}.  "
    f"[default: {_USUAL}, and {' or '.join(_WORLDS[3:])} if the dataset has it]",
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
@number_option("--episodes", "Searches per building and world.", default=200)
@mask_options(
    "What the robot has seen before the search.",
    "Share of the objects to hide; the artifact is always hidden.",
    min_open=True,
)
@click.option(
    "--look",
    type=_read_look,
    default="0",
    metavar="COST",
    help="Cost of a look: 0, and a robot has looked into every room that it enters; a number; or "
    "`usual`, by the size of the room.  [default: 0]",
)
@click.option(
    "--chance",
    type=click.FloatRange(0, 1, min_open=True),
    default=1.0,
    show_default=True,
    help="Chance that a look finds an object that is there; below 1, --look is above 0.",
)
@choice_option(
    "--start",
    ["elsewhere", "anywhere"],
    "Start in a room without the artifact, or in any room; `anywhere` needs --look above 0.",
    default="elsewhere",
)
@number_option(
    "--robots",
    "Robots that search together: --task single --start anywhere, and the planner expected-cost.",
    default=1,
)
@click.option(
    "--trace",
    type=_read_number,
    metavar="[N]",
    is_flag=False,
    flag_value="auto",
    help="Write one search as a page, beside the same search by `nearest`: search N of the first "
    "building; without N, the first eventful one.",
)
@click.option("--scene", help="Search only this building.")
@out_option("Folder of the results.  [default: search in the first run, or search]")
@workers_option
@seed_option
@force_option
@json_option
def main(
    dataset: Path,
    model: tuple[str, ...],
    planners: str | None,
    worlds: str | None,
    artifacts: str,
    workers: int,
    as_json: bool,
    **options: Any,
) -> None:
    """Search buildings for objects with every planner, and say what each saves.

    All planners do the same searches. Savings are relative to `nearest`, which goes to the nearest
    unexplored room. docs/search.md describes planners and worlds.

    \b
    Example:
      bsg-search dataset
      bsg-search dataset --model run --worlds star:1-10 --artifacts stove,bed --trace
      bsg-search dataset --worlds layout --look usual --chance 0.8 --start anywhere
    """
    chosen = split_names(planners, option="--planners")
    graphs = split_names(worlds, option="--worlds")
    require_known("planner", chosen or (), PLANNERS)
    require_known("world", [world.partition(":")[0] for world in graphs or ()], _WORLDS)
    if "none" in model and len(model) > 1:
        raise click.UsageError("--model none excludes other models; give one of them")
    # Imported here: a help or a typo must not wait for SciPy and pandas.
    from bsg_models.runs.found_model import locate_run
    from bsg_models.studies.savings import tabulate_savings
    from bsg_models.studies.search_report import report_search
    from bsg_models.studies.search_request import SearchRequest, choose_default_run

    runs = () if model == ("none",) else tuple(map(locate_run, model))
    if not model:
        runs, note = choose_default_run(dataset, planners=chosen, split=options["split"])
        if note:
            print_note(note)
    request = SearchRequest.read(
        dataset,
        runs=runs,
        planners=chosen,
        worlds=graphs,
        artifacts=split_names(artifacts, option="--artifacts") or (),
        **options,
    )
    with worker_pool(workers) as executor, progress_bar("search", unit="building") as progress:
        report = report_search(request, executor=executor, progress=progress)
    for note in report.notes:
        print_note(note)
    if as_json:
        print_json(report.summary)
        return
    names = report.summary["recipe"]["artifacts"]
    sought = f"any of {len(names)} classes" if len(names) > 12 else ", ".join(names)
    print_text(f"artifacts: {sought}; model: {report.summary['model'] or 'none'}")
    for table in tabulate_savings(report.results):
        print_text(f"\n{table.caption}\n{format_text(table.rows, header=table.header)}")
    print_text(f"\nall results: {report.report}; files:")
    print_text("\n".join(f"  {path}  {what}" for what, path in report.written.items()))
