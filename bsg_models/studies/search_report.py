"""Run a search study as a request asks, and write its files.

OUT/search.json         every result
OUT/searches.parquet    one row per search
OUT/search.html         the tables and the box plot as one page
OUT/savings.png         a box plot over buildings
OUT/trace.html          one search, room by room, beside the same search by `nearest`
OUT/SHA256SUMS          the seal of all files, written last: its presence means finished
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import Executor
from pathlib import Path
from typing import Any, NamedTuple

from bsg_data.dataset.dataset import Dataset
from bsg_data.files import encode_json, noting_failures, write_bytes
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.results import write_results
from bsg_models.evaluation.bootstrap import LEAST_BUILDINGS
from bsg_models.rendering.figures import plot_savings
from bsg_models.rendering.pages import write_report
from bsg_models.rendering.replay import replay_page
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.found_model import name_run
from bsg_models.runs.run_folder import checkpoint_of
from bsg_models.studies.replay import replay_search
from bsg_models.studies.savings import (
    WorldResult,
    encode_study,
    saving_of_buildings,
    summarise,
    tabulate_savings,
    write_searches,
)
from bsg_models.studies.search_request import BASELINE, SearchRequest, choose_buildings
from bsg_models.studies.search_study import Study, study_search

_REPORT, _TABLE, _PAGE = "search.json", "searches.parquet", "search.html"
_FIGURE, _TRACE = "savings.png", "trace.html"


class SearchReport(NamedTuple):
    """A search study and its files."""

    results: list[WorldResult]  # of every world and task
    summary: dict[str, Any]  # the study as JSON
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
    folder = request.folder
    written = {"every search": folder / _TABLE, "tables as one page": folder / _PAGE}
    with write_results(folder, report=_REPORT, force=request.force) as staged:
        data = Dataset.open(request.dataset)
        chosen, notes = choose_buildings(request, data)
        study = study_search(request.dataset, chosen, request, executor=executor, progress=progress)
        results = summarise(study, resamples=request.resamples)
        facts = _list_facts(request)
        summary = encode_study(
            study, results, classes=data.manifest.class_space.classes, facts=facts
        )
        with noting_failures(notes):
            if len(study.planners) > 1:  # others than `nearest`
                _plot(study, staged / _FIGURE, model=facts["model"])
                written["box plot over buildings"] = folder / _FIGURE
        _write_page(results, staged, model=facts["model"])
        if request.trace is not None:
            replay = replay_search(
                data, study, results, chosen, model=facts["model"], trace=request.trace
            )
            write_bytes(staged / _TRACE, replay_page(replay).encode())
            which = f"{replay.scene_id} in {replay.world}, {replay.task}, by"
            which = f"search {replay.episode} of {which} {replay.walks[0].planner}"
            written[which] = folder / _TRACE
        write_searches(study, staged / _TABLE)
        write_bytes(staged / _REPORT, (encode_json(summary, indent=1) + "\n").encode())
    notes += _list_notes(request, study, results)
    return SearchReport(results, summary, folder / _REPORT, written, tuple(notes))


def _list_facts(request: SearchRequest) -> dict[str, Any]:
    """Return what the study does not know of its dataset and runs."""
    checkpoints = [checkpoint_of(run) for run in request.runs]
    names = dict.fromkeys(read_header(path).config.name for path in checkpoints)
    return {
        "dataset": str(request.dataset),
        "runs": [name_run(run) for run in request.runs],
        "checkpoints_sha256": [hash_file(path) for path in checkpoints],
        "model": ", ".join(names) or None,
        "split": None if request.split == "all" else request.split,
        "resamples": request.resamples,
    }


def _list_notes(request: SearchRequest, study: Study, results: list[WorldResult]) -> Iterator[str]:
    for world, reasons in study.left_out.items():
        for reason, number in reasons.items():
            yield f"{world}: {number} of {len(study.scenes)} buildings left out: {reason}"
    if request.resamples > 1 and any(result.buildings < LEAST_BUILDINGS for result in results):
        yield f"intervals are over buildings, and need {LEAST_BUILDINGS} of them"


def _plot(study: Study, path: Path, *, model: str | None) -> None:
    """Plot what planners save."""
    panels = {}
    for (world, task), searches in study.searches.groupby(["world", "task"], sort=False):
        saved = saving_of_buildings(searches)
        panels[f"{world}, {task}, {len(saved)} buildings"] = {
            name: saved[name].to_numpy() for name in study.planners if name != BASELINE
        }
    of_model = f" with the beliefs of {model}" if model else ""
    plot_savings(panels, path, title=f"Object search{of_model}", whole="oracle")


def _write_page(results: list[WorldResult], staged: Path, *, model: str | None) -> None:
    """Write the tables of every world and the box plot as one page."""
    figure = staged / _FIGURE
    write_report(
        staged / _PAGE,
        title=f"Object search: {model or 'no model'}",
        facts=[
            "What each planner saves of the cost of nearest, which goes to the nearest room, with "
            "95 % intervals over buildings. Wins are searches that cost less than with nearest."
        ],
        tables=list(tabulate_savings(results)),
        figures={"Saved, by building": figure} if figure.is_file() else {},
    )
