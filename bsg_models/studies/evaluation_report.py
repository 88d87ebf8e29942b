"""Evaluate runs and write the results.

OUT/evaluation.json     every metric
OUT/classes.csv         one row per model, node set and class
OUT/MODEL-*.png         the paper's figures
OUT/SHA256SUMS          the seal of all files, written last: its presence means finished
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bsg_data.dataset.manifest import read_manifest
from bsg_data.files import encode_json, write_bytes
from bsg_data.places import refuse_datasets
from bsg_data.results import was_stopped, write_files, write_results
from bsg_models.belief.belief_graph import believe
from bsg_models.belief.masked_graph import list_withheld, mask_dataset
from bsg_models.evaluation.prediction_files import PredictionWriter
from bsg_models.evaluation.verdict import headline_rows, judge_all, metric_rows
from bsg_models.rendering.explorer import ShownBelief, explorer_page
from bsg_models.rendering.figures import plot_evaluation
from bsg_models.rendering.pages import Table, write_report
from bsg_models.runs.predictor import Predictor
from bsg_models.studies.comparison import Comparison, EvaluationRequest, compare_runs
from bsg_models.studies.stored_pairs import MeasuredPairs, name_entry

REPORT, CLASSES = "evaluation.json", "classes.csv"


class EvaluationReport(NamedTuple):
    """An evaluation and its files."""

    comparison: Comparison  # of the runs and the baselines
    summary: dict[str, Any]  # the comparison as JSON
    report: Path  # file of the summary
    classes: Path  # file of the metrics by class
    figures: dict[str, Path]  # caption → file
    notes: tuple[str, ...]  # about figures that cannot be drawn


def report_evaluation(
    request: EvaluationRequest, *, progress: Callable[[int, int], None] | None = None
) -> EvaluationReport:
    """Measure runs and baselines, and write the results.

    Args:
        request: what to compare, on which buildings.
        progress: called with (masked buildings done, in all).

    Raises:
        DatasetError: if the split has no pairs, or results already exist.
        CheckpointError: if a run cannot be loaded, or the runs were trained for different folds.
        MismatchError: if a run predicts the classes of another class map.
        PredictionError: if predictions cannot be read, or do not fit the pairs.
    """
    folder, force = request.folder, request.force
    pages = [] if request.html is None else [request.html]
    if request.write_predictions is not None:
        refuse_datasets(request.write_predictions)
    left = was_stopped([folder, *pages])
    with (
        write_results(folder, report=REPORT, force=force) as staged,
        write_files(pages, force=force, left=left) as beside,
    ):
        with ExitStack() as opened:

            def begin(pairs: MeasuredPairs, name: str, fold: int | None) -> PredictionWriter:
                path = (request.write_predictions or folder) / name_entry(name, fold)
                files = opened.enter_context(write_files([path], force=force, left=left))
                return opened.enter_context(pairs.open_entry(files[path]))

            write = begin if request.write_predictions else None
            comparison = compare_runs(request, write=write, progress=progress)
        summary, notes = _encode_comparison(comparison), list[str]()
        figures = _draw(staged, comparison, notes)
        write_bytes(staged / CLASSES, comparison.classes.to_csv(index=False).encode())
        write_bytes(staged / REPORT, (encode_json(summary, indent=1) + "\n").encode())
        for page in pages:
            _write_page(beside[page], comparison, request, figures)
    figures = {what: folder / path.name for what, path in figures.items()}
    return EvaluationReport(
        comparison, summary, folder / REPORT, folder / CLASSES, figures, tuple(notes)
    )


def _draw(folder: Path, comparison: Comparison, notes: list[str]) -> dict[str, Path]:
    """Draw the paper's figures of every run; return caption → file."""
    return {
        f"{name}: {what}": path
        for name in comparison.runs
        for what, path in plot_evaluation(
            folder,
            name=name,
            shown=comparison.shown[name],
            classes=comparison.class_names,
            building=comparison.example,
            notes=notes,
        ).items()
    }


def _write_page(
    path: Path, comparison: Comparison, request: EvaluationRequest, figures: Mapping[str, Path]
) -> None:
    """Write the evaluation as one page, with an explorer of the run of lowest hidden NLL."""
    estimates = comparison.estimates
    likelihood = [estimates[name]["rooms/hidden_nll"].value for name in comparison.facts["runs"]]
    explorer = None
    if request.runs:
        best = request.runs[int(np.argmin(likelihood))]
        explorer = explorer_page(_look_into(comparison, best, request))
    write_report(
        path,
        title=f"Evaluation: {', '.join(comparison.runs)}",
        facts=[
            f"Measured on {len(comparison.buildings)} buildings of {request.dataset.name} "
            f"({comparison.facts['split']}), compared with the baselines. "
            "± is half of a 95 % interval over buildings; ↓ less is better, ↑ more is better.",
            *comparison.notes,
        ],
        findings=judge_all(comparison.bootstraps, runs=comparison.runs)
        if comparison.has_verdicts
        else {},
        tables=[
            Table("In short", ["metric", *estimates], headline_rows(estimates)),
            Table(
                "Every metric",
                ["metric", "nodes", *estimates],
                metric_rows(estimates),
                folded=True,
            ),
        ],
        figures=figures,
        explorer=explorer,
    )


def _look_into(
    comparison: Comparison, run: Path | str, request: EvaluationRequest
) -> list[ShownBelief]:
    """Return a run's beliefs about the median, the smallest and the largest building."""
    predictor = Predictor(run)
    wanted = [comparison.example, comparison.buildings[0], comparison.buildings[-1]]
    recipe = (read_manifest(request.dataset).pairs or request.fresh).mask
    views = {}
    for seen, truth in mask_dataset(request.dataset, wanted, recipe):
        expectation = predictor(seen, withheld=list_withheld(recipe, seen))
        belief = believe(seen, expectation, model=predictor.name)
        views[seen.scene_id] = ShownBelief(belief, truth)
    return [views[scene] for scene in dict.fromkeys(wanted)]


def _encode_comparison(comparison: Comparison) -> dict[str, Any]:
    """Return a comparison as JSON: metric → model → value, interval, nodes; unknown is null."""
    metrics: dict[str, dict[str, Any]] = {}
    for model, estimates in comparison.estimates.items():
        for name, estimate in estimates.items():
            metrics.setdefault(name, {})[model] = estimate.encode()
    return {**comparison.facts, "notes": list(comparison.notes), "metrics": metrics}
