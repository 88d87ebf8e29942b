"""Measure the cost that beliefs of a leaderboard's models save in object search.

    python scripts/measure/search.py --leaderboard board --out docs/results/search.md --brief

Every building is searched with the beliefs of the model that was trained without its fold.
`--brief` makes a quarter of the searches. docs/search.md describes planners and worlds.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from contextlib import nullcontext
from datetime import date
from multiprocessing import get_context
from pathlib import Path

from fold_models import list_models, open_dataset, open_folds
from results_page import ResultsPage, ResultsTable, describe, write_page

from bsg_models.evaluation.bootstrap import Estimate
from bsg_models.studies.savings import WorldResult
from bsg_models.studies.search_report import SearchRequest, report_search

WORLDS = ("star:1-10", "complete:5-10", "tree:1-10", "layout")
PLANNERS = ("greedy-share", "expected-cost", "oracle")
ENDS = {"single": "the first object of the class is", "all": "all objects of the class are"}


def format_percent(estimate: Estimate) -> str:
    """Return a share in per cent with its interval."""
    value, low, high = (100 * one for one in (estimate.value, estimate.low, estimate.high))
    if value != value:
        return "–"
    return f"{value:.1f}" if low != low else f"{value:.1f} ({low:.1f} to {high:.1f})"


def tabulate(
    found: dict[str, list[WorldResult]], task: str, *, again: bool = False
) -> ResultsTable:
    """Return the cost that each model and planner saves, a column a world, for one task.

    Args:
        found: results of each model.
        task: which of its results are shown.
        again: whether a table above explains the values.
    """
    worlds = list(dict.fromkeys(one.world for results in found.values() for one in results))
    rows = []
    for model, results in found.items():
        by_world = {one.world: one for one in results if one.task == task}
        for planner in PLANNERS:
            if planner == "oracle" and model != next(iter(found)):
                continue
            cells = [format_percent(by_world[world].savings[planner].saved) for world in worlds]
            who = "the truth" if planner == "oracle" else f"`{model}`"
            rows.append((who, f"`{planner}`", *cells))
    first = [one for one in next(iter(found.values())) if one.task == task]
    number = ", ".join(f"{one.buildings} of `{one.world}`" for one in first)
    values = (
        "All else is as above."
        if again
        else "Values are the cost saved compared with going to the nearest room, in per cent, with "
        "95 % intervals over buildings. Below 0, the planner costs more. "
        f"Buildings: {number}."
    )
    reading = f"The search ends when {ENDS[task]} found. {values}"
    return ResultsTable(f"Task `{task}`", ("belief of", "planner", *worlds), tuple(rows), reading)


def conclude(found: dict[str, list[WorldResult]]) -> tuple[str, ...]:
    """Return the least and the most that `expected-cost` saves in a world, for each task."""
    saved: dict[str, dict[str, list[float]]] = {}
    for model, results in found.items():
        for one in results:
            value = 100 * one.savings["expected-cost"].saved.value
            if value == value:  # not nan
                saved.setdefault(one.task, {}).setdefault(model, []).append(value)
    sentences = []
    for task, by_model in saved.items():
        parts = [
            f"`{model}` saves {min(values):.1f} to {max(values):.1f} %"
            for model, values in by_model.items()
        ]
        sentences.append(f"- Task `{task}`, until {ENDS[task]} found: {'; '.join(parts)}.")
    lead = (
        "Cost that the planner `expected-cost` saves compared with going to the nearest room, from "
        "the worst to the best world:"
    )
    return ("\n".join([lead, "", *sentences]),)


def main(argv: Sequence[str] | None = None) -> int:
    """Search, and write the page."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--leaderboard", type=Path, required=True, help="folder of bsg-leaderboard")
    parser.add_argument("--out", type=Path, required=True, help="page to write")
    parser.add_argument("--models", nargs="*", help="NAME@MASK; default: all")
    parser.add_argument("--worlds", nargs="*", default=list(WORLDS))
    parser.add_argument("--draws", type=int, default=10, help="masks of every building")
    parser.add_argument("--episodes", type=int, default=200, help="searches of every building")
    parser.add_argument("--brief", action="store_true", help="a quarter of the searches")
    parser.add_argument("--resamples", type=int, default=1000)
    parser.add_argument("--workers", type=int, default=1)
    options = parser.parse_args(argv)
    board = options.leaderboard
    spawn = get_context("spawn")
    found: dict[str, list[WorldResult]] = {}
    with (
        ProcessPoolExecutor(options.workers, mp_context=spawn)
        if options.workers > 1
        else nullcontext()
    ) as executor:
        for name in options.models or list_models(board):
            with tempfile.TemporaryDirectory() as folder:
                request = SearchRequest(
                    dataset=open_dataset(board, name).path,
                    runs=tuple(one.run for one in open_folds(board, name)),
                    planners=PLANNERS,
                    worlds=tuple(options.worlds),
                    episodes=max(1, options.episodes // (4 if options.brief else 1)),
                    masks=options.draws,
                    resamples=options.resamples,
                    out=Path(folder) / "search",
                )
                found[name] = report_search(request, executor=executor).results
            print(f"searched with {name}", flush=True)
    data = open_dataset(board, next(iter(found)))
    page = ResultsPage(
        "What a belief saves in object search",
        conclude(found),
        (tabulate(found, "single"), tabulate(found, "all", again=True)),
        describe(data, [__file__, *(argv or sys.argv[1:])], date=date.today().isoformat()),
    )
    write_page(page, options.out)
    return 0


if __name__ == "__main__":
    sys.exit(main())
