"""`bsg-evaluate`: every metric for one run or more, beside the baselines that keep it honest."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import click
import numpy as np

from bsg_data.errors import DatasetError
from bsg_data.shards import write_bytes
from bsg_models.comparison import Comparison, compare_runs
from bsg_models.evaluation import Estimate
from bsg_models.figures import draw_evaluation

from .terminal import (
    Command,
    force_option,
    format_table,
    json_option,
    print_json,
    print_note,
    progress_bar,
    seed_option,
)

SHORT = (
    "rooms/hidden_nll",
    "rooms/presence_auroc_macro/all",
    "rooms/presence_auroc_micro/all",
    "rooms/presence_ap_micro/all",
    "rooms/presence_auroc_macro/unseen",
    "rooms/presence_ap_micro/unseen",
    "rooms/presence_brier/all",
    "rooms/presence_calibration_error/all",
    "rooms/top1_unseen",
    "rooms/top3_unseen",
    "rooms/top5_unseen",
    "rooms/total_variation/mean",
    "rooms/mean_absolute_error",
    "building/mean_absolute_error",
    "all/wasserstein_values/mean",
    "all/wasserstein_values/variance",
    "all/wasserstein_values/skewness",
    "all/wasserstein_values/kurtosis",
    "all/energy_values/mean",
    "all/energy_values/variance",
    "all/energy_values/skewness",
    "all/energy_values/kurtosis",
    "all/wasserstein_classes/mean",
    "all/energy_classes/mean",
    "rooms/correlation_frobenius",
    "building/correlation_frobenius",
    "all/correlation_frobenius",
)


@click.command(cls=Command)
@click.argument(
    "runs", nargs=-1, required=True, type=click.Path(path_type=Path), metavar="RUN [RUN...]"
)
@click.option("--data", type=click.Path(path_type=Path), required=True, help="Dataset with pairs.")
@click.option(
    "--split",
    type=click.Choice(["train", "val", "test"]),
    default="test",
    show_default=True,
    help="What to measure on.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder for evaluation.json, classes.csv and figures.  [default: RUN/evaluation]",
)
@click.option(
    "--resamples",
    type=click.IntRange(min=0),
    default=200,
    show_default=True,
    help="Bootstrap resamples of the buildings; 0 for no intervals.",
)
@click.option("--all-metrics", is_flag=True, help="Print every metric, not the main ones.")
@seed_option
@force_option
@json_option
@click.version_option(package_name="belief-scene-graphs", prog_name="bsg-evaluate")
def main(
    runs: tuple[Path, ...],
    data: Path,
    split: str,
    out: Path | None,
    resamples: int,
    all_metrics: bool,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    """Measure runs on a split, beside the baselines.

    \b
    Example:
      bsg-evaluate run --data dataset --split test
    """
    out = out or runs[0] / "evaluation"
    report = out / "evaluation.json"
    if report.exists() and not force:
        raise DatasetError(f"{report}: is there already; --force replaces it")
    with progress_bar("evaluate", unit="resample") as progress:
        found = compare_runs(
            runs, data, split=split, resamples=resamples, seed=seed, progress=progress
        )
    summary = summarise(found, split=split)
    write_bytes(report, (json.dumps(summary, indent=1) + "\n").encode())
    write_bytes(out / "classes.csv", found.classes.to_csv(index=False).encode())
    figures = _draw(found, out)
    for note in found.notes:
        print_note(note)
    if as_json:
        print_json(summary)
        return
    names = [n for n in summary["metrics"] if all_metrics or n in SHORT]
    order = {name: i for i, name in enumerate(SHORT)}
    names.sort(key=lambda name: order.get(name, len(order)))
    click.echo(_table(found.estimates, names, resamples=resamples))
    click.echo("\n" + "\n".join(explain(found.estimates, runs=found.runs)))
    click.echo(f"\nreport {report}, per class {out / 'classes.csv'}")
    click.echo("\n".join(f"figure {path}: {what}" for what, path in figures.items()))


def summarise(found: Comparison, *, split: str) -> dict[str, Any]:
    """Return a comparison as JSON: metric → model → value, interval, nodes."""
    metrics: dict[str, dict[str, Any]] = {}
    for model, estimates in found.estimates.items():
        for name, e in estimates.items():
            values = {"value": e.value, "low": e.low, "high": e.high}
            plain = {k: None if np.isnan(v) else v for k, v in values.items()}
            metrics.setdefault(name, {})[model] = {**plain, "nodes": e.nodes}
    return {"split": split, **found.facts, "metrics": metrics}


def explain(estimates: Mapping[str, Mapping[str, Estimate]], *, runs: Sequence[str]) -> list[str]:
    """Say in plain words where each run stands beside doubling what was seen."""
    lines = []
    for run in runs:
        ours, doubled = estimates[run], estimates["doubled"]
        worse = [what for what, name, sign in _HEADLINES if _loses(ours, doubled, name, sign)]
        better = [what for what, _, _ in _HEADLINES if what not in worse]
        lines.append(f"{run}, beside doubling what was seen:")
        lines.append(f"  better at {', '.join(better) or 'nothing'}")
        lines.append(f"  no better at {', '.join(worse) or 'nothing'}")
    return lines


_HEADLINES = (
    ("the likelihood of what is hidden", "rooms/hidden_nll", 1),
    ("saying which classes are hidden in a room (AUROC)", "rooms/presence_auroc_macro/all", -1),
    ("naming classes not seen in the room (AUROC)", "rooms/presence_auroc_macro/unseen", -1),
    ("the right distribution over classes (total variation)", "rooms/total_variation/mean", 1),
    ("the number of objects in a room", "rooms/mean_absolute_error", 1),
    ("the paper's Wasserstein distance", "all/wasserstein_values/mean", 1),
    ("the paper's energy distance", "all/energy_values/mean", 1),
    ("the paper's Frobenius norm", "rooms/correlation_frobenius", 1),
)


def _loses(
    ours: Mapping[str, Estimate], other: Mapping[str, Estimate], name: str, sign: int
) -> bool:
    return not sign * ours[name].value < sign * other[name].value


def _table(
    estimates: Mapping[str, Mapping[str, Estimate]], names: Sequence[str], *, resamples: int
) -> str:
    """Return values ± half the width of their 95 % intervals, a column a model."""
    rows = []
    for name in names:
        cells = [_cell(found[name], interval=resamples > 0) for found in estimates.values()]
        rows.append([name, str(next(iter(estimates.values()))[name].nodes), *cells])
    return format_table(rows, header=["metric", "nodes", *estimates])


def _cell(estimate: Estimate, *, interval: bool) -> str:
    if np.isnan(estimate.value):
        return "-"
    value = f"{estimate.value:.4g}"
    half = (estimate.high - estimate.low) / 2
    return f"{value} ±{half:.2g}" if interval and not np.isnan(half) else value


def _draw(found: Comparison, out: Path) -> dict[str, Path]:
    figures: dict[str, Path] = {}
    for name in found.runs:
        drawn = draw_evaluation(
            out,
            name=name,
            expectation=found.expectations[name],
            target=found.truth.targets,
            is_building=found.truth.is_building,
            classes=found.class_names,
            node=found.example_node,
            building=found.example_building,
        )
        figures.update({f"{name}: {what}": path for what, path in drawn.items()})
    return figures
