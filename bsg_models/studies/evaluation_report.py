"""The evaluation of runs: what to compare, and the files that it leaves.

OUT/evaluation.json     every metric, written last: it means finished
OUT/classes.csv         one row a model, node set and class
OUT/RUN-*.png           the paper's figures
"""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal, NamedTuple

import numpy as np
from pydantic import Field

from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.shards import write_bytes
from bsg_data.errors import DatasetError
from bsg_data.observation.partial_graph import mask_dataset
from bsg_data.recipes import MaskRecipe, Record
from bsg_models.belief.belief_graph import believe
from bsg_models.evaluation.measurement import Estimate
from bsg_models.rendering.explorer import View, explorer_page
from bsg_models.rendering.figures import plot_evaluation
from bsg_models.rendering.report import Table, write_report
from bsg_models.runs.predictor import Predictor
from bsg_models.studies.comparison import Comparison, compare_runs

REPORT, CLASSES = "evaluation.json", "classes.csv"
# What the terminal shows: a plain name, the metric, and whether less of it is better.
HEADLINES = (
    ("hidden objects, -log likelihood", "rooms/hidden_nll", True),
    ("hidden classes, AUROC", "rooms/presence_auroc_macro/all", False),
    ("hidden classes, calibration error", "rooms/presence_calibration_error/all", True),
    ("unseen classes, AUROC over rooms", "rooms/presence_auroc_macro/unseen", False),
    ("unseen classes, AUROC over all", "rooms/presence_auroc_micro/unseen", False),
    ("unseen classes, top 3 holds one", "rooms/top3_unseen", False),
    ("error in number, rooms", "rooms/mean_absolute_error", True),
    ("error in number, building", "building/mean_absolute_error", True),
    ("total variation, rooms", "rooms/total_variation/mean", True),
    ("Wasserstein, all nodes", "all/wasserstein_values/mean", True),
    ("energy, all nodes", "all/energy_values/mean", True),
    ("Frobenius, rooms", "rooms/correlation_frobenius", True),
)


class EvaluationRequest(Record):
    """What to compare, and which files to write.

    Attributes:
        runs: folders of trained models.
        dataset: that is split and has pairs.
        split: to measure on.
        out: folder of the results; None for `evaluation` in the first run.
        html: one page with all results; None for none.
        resamples: of the bootstrap over buildings; 0 for no intervals.
        seed: of the bootstrap.
        force: replace results that are there.
    """

    runs: tuple[Path, ...] = Field(min_length=1)
    dataset: Path
    split: Literal["train", "val", "test"] = "test"
    out: Path | None = None
    html: Path | None = None
    resamples: int = Field(default=200, ge=0)
    seed: int = Field(default=0, ge=0)
    force: bool = False

    @property
    def folder(self) -> Path:
        """The folder of the results."""
        return self.out or self.runs[0] / "evaluation"


class EvaluationReport(NamedTuple):
    """An evaluation and its files.

    Attributes:
        comparison: of the runs and the baselines.
        summary: the same as JSON.
        report: file of the summary.
        classes: file of the metrics by class.
        figures: what is drawn → file.
    """

    comparison: Comparison
    summary: dict[str, Any]
    report: Path
    classes: Path
    figures: dict[str, Path]


def report_evaluation(
    request: EvaluationRequest, *, progress: Callable[[int, int], None] | None = None
) -> EvaluationReport:
    """Measure runs beside the baselines, and write the results.

    Args:
        request: what to compare, on what.
        progress: called with (resamples done, in all).

    Raises:
        DatasetError: if the split has no pairs, or results are there already.
        CheckpointError: if a run cannot be loaded, or the runs were trained for different folds.
        MismatchError: if a run is of another class map.
    """
    report, classes = request.folder / REPORT, request.folder / CLASSES
    if report.exists() and not request.force:
        raise DatasetError(
            f"{report}: is there already; --force replaces it, --out puts it elsewhere"
        )
    if request.html is not None and request.html.exists() and not request.force:
        raise DatasetError(f"{request.html}: is there already; --force replaces it")
    comparison = compare_runs(
        request.runs,
        request.dataset,
        split=request.split,
        resamples=request.resamples,
        seed=request.seed,
        progress=progress,
    )
    summary = summarise(comparison, split=request.split)
    figures = _plot(comparison, request.folder)
    write_bytes(classes, comparison.classes.to_csv(index=False).encode())
    if request.html is not None:
        _write_page(request.html, comparison, request, figures)
    write_bytes(report, (json.dumps(summary, indent=1) + "\n").encode())
    return EvaluationReport(comparison, summary, report, classes, figures)


def summarise(comparison: Comparison, *, split: str) -> dict[str, Any]:
    """Return a comparison as JSON: metric → model → value, interval, nodes."""
    metrics: dict[str, dict[str, Any]] = {}
    for model, estimates in comparison.estimates.items():
        for name, e in estimates.items():
            values = {"value": e.value, "low": e.low, "high": e.high}
            plain = {k: None if np.isnan(v) else v for k, v in values.items()}
            metrics.setdefault(name, {})[model] = {**plain, "nodes": e.nodes}
    return {"split": split, **comparison.facts, "notes": list(comparison.notes), "metrics": metrics}


def explain(estimates: Mapping[str, Mapping[str, Estimate]], *, runs: Sequence[str]) -> list[str]:
    """Say in plain words where each run stands beside doubling what was seen."""
    lines = []
    for run, verdicts in judge_all(estimates, runs=runs).items():
        lines.append(f"{run}, beside doubling what was seen (by 95 % intervals):")
        for verdict, labels in verdicts.items():
            lines.append(f"  {verdict}: {labels[0]}")
            lines += [" " * (len(verdict) + 4) + label for label in labels[1:]]
    return lines


def judge_all(
    estimates: Mapping[str, Mapping[str, Estimate]], *, runs: Sequence[str]
) -> dict[str, dict[str, list[str]]]:
    """Return run → verdict → the measures in which it is so, beside doubling what was seen."""
    judged = {}
    for run in runs:
        verdicts: dict[str, list[str]] = {"better": [], "not distinguishable": [], "worse": []}
        for label, name, less in HEADLINES:
            verdict = judge(estimates[run][name], estimates["doubled"][name], less=less)
            verdicts[verdict].append(label)
        judged[run] = {verdict: labels for verdict, labels in verdicts.items() if labels}
    return judged


def judge(ours: Estimate, other: Estimate, *, less: bool) -> str:
    """Return better, worse or not distinguishable, by whether the intervals are apart."""
    ends = [(e.value, e.value) if np.isnan(e.low) else (e.low, e.high) for e in (ours, other)]
    (low, high), (other_low, other_high) = ends
    if high < other_low:
        return "better" if less else "worse"
    if low > other_high:
        return "worse" if less else "better"
    return "not distinguishable"


def headline_rows(
    estimates: Mapping[str, Mapping[str, Estimate]], *, resamples: int
) -> list[list[str]]:
    """Return a row of text for each headline, with a cell for each model."""
    return [
        [f"{label} {'↓' if less else '↑'}", *_cells(estimates, name, resamples=resamples)]
        for label, name, less in HEADLINES
    ]


def metric_rows(
    estimates: Mapping[str, Mapping[str, Estimate]], *, resamples: int
) -> list[list[str]]:
    """Return a row of text for each metric: its name, its nodes, and a cell for each model."""
    first = next(iter(estimates.values()))
    return [
        [name, str(first[name].nodes), *_cells(estimates, name, resamples=resamples)]
        for name in first
    ]


def _write_page(
    path: Path, comparison: Comparison, request: EvaluationRequest, figures: Mapping[str, Path]
) -> None:
    """Write the evaluation as one page, with buildings that the likeliest run believes in."""
    estimates, resamples = comparison.estimates, request.resamples
    likelihood = [estimates[name]["rooms/hidden_nll"].value for name in comparison.runs]
    best = int(np.argmin(likelihood))
    write_report(
        path,
        title=f"What is hidden, and how well it is known: {', '.join(comparison.runs)}",
        facts=[
            f"{len(comparison.truth.scene_ids)} {request.split} buildings of "
            f"{request.dataset.name}, beside baselines. "
            "± is half of a 95 % interval over buildings; ↓ less is better, ↑ more is better.",
            *comparison.notes,
        ],
        findings={
            f"{run}, beside doubling what was seen (by 95 % intervals)": verdicts
            for run, verdicts in judge_all(estimates, runs=comparison.runs).items()
        },
        tables=[
            Table(
                "In short",
                ["metric", *estimates],
                headline_rows(estimates, resamples=resamples),
            ),
            Table(
                "Every metric",
                ["metric", "nodes", *estimates],
                metric_rows(estimates, resamples=resamples),
            ),
        ],
        figures=figures,
        explorer=explorer_page(_look_into(comparison, request.runs[best], request.dataset)),
    )


def _look_into(comparison: Comparison, run: Path, data: Path) -> list[View]:
    """Return what a run believes about the median, the smallest and the largest building."""
    manifest, predictor, measured = read_manifest(data), Predictor(run), comparison.truth
    rows = np.flatnonzero(measured.is_building & (measured.draw == measured.draw.min()))
    order = rows[np.argsort(measured.targets[rows].sum(axis=1), kind="stable")]
    chosen = dict.fromkeys([comparison.example_node, int(order[0]), int(order[-1])])
    wanted = [measured.scene_ids[int(measured.building[row])] for row in chosen]
    recipe = manifest.pairs.mask if manifest.pairs else MaskRecipe()
    views = {}
    for seen, truth in mask_dataset(data, wanted, recipe):
        belief = believe(seen, predictor(seen), model=predictor.name)
        views[seen.scene_id] = View(belief, truth)
    return [views[scene] for scene in dict.fromkeys(wanted)]


def _cells(
    estimates: Mapping[str, Mapping[str, Estimate]], name: str, *, resamples: int
) -> list[str]:
    """Return values ± half the width of their 95 % intervals, one a model."""
    return [_cell(one[name], interval=resamples > 1) for one in estimates.values()]


def _cell(estimate: Estimate, *, interval: bool) -> str:
    if np.isnan(estimate.value):
        return "-"
    value = f"{estimate.value:.3g}"
    half = (estimate.high - estimate.low) / 2
    return f"{value} ±{half:.1g}" if interval and not np.isnan(half) else value


def _plot(comparison: Comparison, out: Path) -> dict[str, Path]:
    figures: dict[str, Path] = {}
    for name in comparison.runs:
        drawn = plot_evaluation(
            out,
            name=name,
            expectation=comparison.expectations[name],
            target=comparison.truth.targets,
            is_building=comparison.truth.is_building,
            classes=comparison.class_names,
            node=comparison.example_node,
            building=comparison.example_building,
        )
        figures.update({f"{name}: {what}": path for what, path in drawn.items()})
    return figures
