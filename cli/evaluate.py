"""`bsg-evaluate`: every metric for one run or more, beside the baselines that keep it honest."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, cast, get_args

import click
import numpy as np

from bsg_cli.leaderboard import run_leaderboard
from bsg_cli.terminal import (
    Command,
    force_option,
    format_table,
    json_option,
    print_json,
    print_note,
    progress_bar,
    seed_option,
    workers_option,
)
from bsg_data.dataset.manifest import read_manifest
from bsg_data.errors import DatasetError
from bsg_data.files import write_bytes
from bsg_data.observation.partial_graph import mask_dataset
from bsg_data.recipes import MaskRecipe, Strategy
from bsg_models.belief.belief_graph import believe
from bsg_models.evaluation.measurement import Estimate
from bsg_models.rendering.explorer import View, explorer_page
from bsg_models.rendering.figures import plot_evaluation
from bsg_models.rendering.report import Table, write_report
from bsg_models.runs.predictor import Predictor
from bsg_models.studies.comparison import Comparison, compare_runs
from bsg_models.studies.leaderboard import LeaderboardRecipe

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


@click.command(cls=Command)
@click.argument("runs", nargs=-1, type=click.Path(path_type=Path), metavar="[RUN...]")
@click.option("--leaderboard", is_flag=True, help="Train and measure models in cross-validation.")
@click.option("--models", help="Of the leaderboard: zoo names and TOML files.  [default: the zoo]")
@click.option(
    "--masks",
    default="uniform,rooms",
    show_default=True,
    help="Of the leaderboard: kinds of masks to train and measure on.",
)
@click.option(
    "--folds",
    type=click.IntRange(min=3),
    default=5,
    show_default=True,
    help="Of the leaderboard: parts that the buildings are dealt to.",
)
@click.option(
    "--draws",
    type=click.IntRange(min=1),
    default=5,
    show_default=True,
    help="Of the leaderboard: masks of every building.",
)
@workers_option
@click.option(
    "--data",
    type=click.Path(path_type=Path),
    required=True,
    help="Dataset; with pairs, to measure runs.",
)
@click.option(
    "--split",
    type=click.Choice(["train", "val", "test"]),
    default="test",
    show_default=True,
    help="Of runs: what to measure them on.",
)
@click.option(
    "--out",
    type=click.Path(path_type=Path),
    help="Folder of the results.  [default: evaluation in the first RUN, or leaderboard]",
)
@click.option(
    "--resamples",
    type=click.IntRange(min=0),
    default=200,
    show_default=True,
    help="Bootstrap resamples of the buildings; 0 for no intervals.",
)
@click.option("--html", type=click.Path(path_type=Path), help="Of runs: all as one page, too.")
@click.option("--all-metrics", is_flag=True, help="Of runs: print every metric, too.")
@seed_option
@force_option
@json_option
@click.version_option(package_name="belief-scene-graphs", prog_name="bsg-evaluate")
def main(
    runs: tuple[Path, ...],
    leaderboard: bool,
    models: str | None,
    masks: str,
    folds: int,
    draws: int,
    workers: int,
    data: Path,
    split: str,
    out: Path | None,
    resamples: int,
    html: Path | None,
    all_metrics: bool,
    seed: int,
    force: bool,
    as_json: bool,
) -> None:
    """Measure runs on a split, beside the baselines; or make a leaderboard of models.

    \b
    Example:
      bsg-evaluate run --data dataset --split test
      bsg-evaluate --leaderboard --data dataset --models doubled,mixture,ceci-sage
    """
    if leaderboard:
        if runs:
            raise click.UsageError("--leaderboard trains its own runs; name none")
        run_leaderboard(
            data,
            out or Path("leaderboard"),
            read_recipe(masks, folds=folds, draws=draws, seed=seed, resamples=resamples),
            models=models,
            workers=workers,
            force=force,
            as_json=as_json,
        )
        return
    if not runs:
        raise click.UsageError("name a RUN, or give --leaderboard")
    out = out or runs[0] / "evaluation"
    report = out / "evaluation.json"
    if report.exists() and not force:
        raise DatasetError(
            f"{report}: is there already; --force replaces it, --out puts it elsewhere"
        )
    if html is not None and html.exists() and not force:
        raise DatasetError(f"{html}: is there already; --force replaces it")
    with progress_bar("evaluate", unit="resample") as progress:
        found = compare_runs(
            runs, data, split=split, resamples=resamples, seed=seed, progress=progress
        )
    summary = summarise(found, split=split)
    figures = _draw(found, out)
    write_bytes(out / "classes.csv", found.classes.to_csv(index=False).encode())
    if html is not None:
        _write_page(html, found, runs, data, split=split, figures=figures, resamples=resamples)
    write_bytes(report, (json.dumps(summary, indent=1) + "\n").encode())  # last: it means finished
    for note in found.notes:
        print_note(note)
    if as_json:
        print_json(summary)
        return
    click.echo("\n".join(explain(found.estimates, runs=found.runs)) + "\n")
    click.echo(_headline_table(found.estimates, resamples=resamples))
    if all_metrics:
        click.echo("\n" + _full_table(found.estimates, resamples=resamples))
    click.echo(f"\nall metrics: {report}; per class: {out / 'classes.csv'}; figures:")
    click.echo("\n".join(f"  {path}  {what}" for what, path in figures.items()))


def read_recipe(
    masks: str, *, folds: int, draws: int, seed: int, resamples: int
) -> LeaderboardRecipe:
    """Return the recipe of a leaderboard from its options."""
    names = tuple(dict.fromkeys(name.strip() for name in masks.split(",")))
    unknown = [name for name in names if name not in get_args(Strategy)]
    if unknown:
        known = ", ".join(get_args(Strategy))
        raise click.UsageError(f"--masks: {unknown[0]!r} is none of {known}")
    return LeaderboardRecipe(
        masks=cast(tuple[Strategy, ...], names),
        folds=folds,
        draws=draws,
        seed=seed,
        resamples=resamples,
    )


def summarise(found: Comparison, *, split: str) -> dict[str, Any]:
    """Return a comparison as JSON: metric → model → value, interval, nodes."""
    metrics: dict[str, dict[str, Any]] = {}
    for model, estimates in found.estimates.items():
        for name, e in estimates.items():
            values = {"value": e.value, "low": e.low, "high": e.high}
            plain = {k: None if np.isnan(v) else v for k, v in values.items()}
            metrics.setdefault(name, {})[model] = {**plain, "nodes": e.nodes}
    return {"split": split, **found.facts, "notes": list(found.notes), "metrics": metrics}


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
    found = {}
    for run in runs:
        verdicts: dict[str, list[str]] = {"better": [], "not distinguishable": [], "worse": []}
        for label, name, less in HEADLINES:
            verdict = judge(estimates[run][name], estimates["doubled"][name], less=less)
            verdicts[verdict].append(label)
        found[run] = {verdict: labels for verdict, labels in verdicts.items() if labels}
    return found


def judge(ours: Estimate, other: Estimate, *, less: bool) -> str:
    """Return better, worse or not distinguishable, by whether the intervals are apart."""
    ends = [(e.value, e.value) if np.isnan(e.low) else (e.low, e.high) for e in (ours, other)]
    (low, high), (other_low, other_high) = ends
    if high < other_low:
        return "better" if less else "worse"
    if low > other_high:
        return "worse" if less else "better"
    return "not distinguishable"


def _headline_table(estimates: Mapping[str, Mapping[str, Estimate]], *, resamples: int) -> str:
    return format_table(_headlines(estimates, resamples=resamples), header=["", *estimates])


def _headlines(
    estimates: Mapping[str, Mapping[str, Estimate]], *, resamples: int
) -> list[list[str]]:
    return [
        [f"{label} {'↓' if less else '↑'}", *_cells(estimates, name, resamples=resamples)]
        for label, name, less in HEADLINES
    ]


def _full_table(estimates: Mapping[str, Mapping[str, Estimate]], *, resamples: int) -> str:
    rows = _every_metric(estimates, resamples=resamples)
    return format_table(rows, header=["metric", "nodes", *estimates])


def _every_metric(
    estimates: Mapping[str, Mapping[str, Estimate]], *, resamples: int
) -> list[list[str]]:
    first = next(iter(estimates.values()))
    return [
        [name, str(first[name].nodes), *_cells(estimates, name, resamples=resamples)]
        for name in first
    ]


def _write_page(
    path: Path,
    found: Comparison,
    runs: Sequence[Path],
    data: Path,
    *,
    split: str,
    figures: Mapping[str, Path],
    resamples: int,
) -> None:
    """Write the evaluation as one page, with buildings that the likeliest run believes in."""
    likelihood = [found.estimates[name]["rooms/hidden_nll"].value for name in found.runs]
    best = int(np.argmin(likelihood))
    names = ["metric", *found.estimates]
    write_report(
        path,
        title=f"What is hidden, and how well it is known: {', '.join(found.runs)}",
        facts=[
            f"{len(found.truth.scene_ids)} {split} buildings of {data.name}, beside baselines. "
            "± is half of a 95 % interval over buildings; ↓ less is better, ↑ more is better.",
            *found.notes,
        ],
        findings={
            f"{run}, beside doubling what was seen (by 95 % intervals)": verdicts
            for run, verdicts in judge_all(found.estimates, runs=found.runs).items()
        },
        tables=[
            Table("In short", names, _headlines(found.estimates, resamples=resamples)),
            Table(
                "Every metric",
                ["metric", "nodes", *found.estimates],
                _every_metric(found.estimates, resamples=resamples),
            ),
        ],
        figures=figures,
        explorer=explorer_page(_look_into(found, runs[best], data)),
    )


def _look_into(found: Comparison, run: Path, data: Path) -> list[View]:
    """Return what a run believes about the median, the smallest and the largest building."""
    manifest, predictor = read_manifest(data), Predictor(run)
    rows = np.flatnonzero(found.truth.is_building & (found.truth.draw == found.truth.draw.min()))
    order = rows[np.argsort(found.truth.targets[rows].sum(axis=1), kind="stable")]
    chosen = dict.fromkeys([found.example_node, int(order[0]), int(order[-1])])
    wanted = [found.truth.scene_ids[int(found.truth.building[row])] for row in chosen]
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
    return [_cell(found[name], interval=resamples > 1) for found in estimates.values()]


def _cell(estimate: Estimate, *, interval: bool) -> str:
    if np.isnan(estimate.value):
        return "-"
    value = f"{estimate.value:.3g}"
    half = (estimate.high - estimate.low) / 2
    return f"{value} ±{half:.1g}" if interval and not np.isnan(half) else value


def _draw(found: Comparison, out: Path) -> dict[str, Path]:
    figures: dict[str, Path] = {}
    for name in found.runs:
        drawn = plot_evaluation(
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
