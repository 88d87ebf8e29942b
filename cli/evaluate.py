"""`bsg-evaluate`: measure runs and predictions with every metric, beside the baselines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import bsg_data
import bsg_models
from bsg_cli.choices import complete_model
from bsg_cli.options import (
    PATH,
    data_option,
    force_option,
    html_option,
    json_option,
    mask_options,
    out_option,
    resamples_option,
    seed_option,
    split_option,
)
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar
from bsg_data.tables import format_text


@click.command("bsg-evaluate", cls=Command)
@click.argument("runs", nargs=-1, metavar="[RUN]...", shell_complete=complete_model)
@data_option("Dataset, with pairs.")
@split_option("Split to measure on.", default="test")
@click.option(
    "--predictions",
    multiple=True,
    type=PATH,
    help="Predictions of any program (docs/benchmark.md): a parquet file or a folder of them.",
)
@click.option(
    "--fold",
    type=click.IntRange(min=0),
    help="Measure this fold; a RUN measures its own.  [default: all folds]",
)
@mask_options(
    "Of a dataset without a split, all buildings of which are measured: how to hide objects.",
    "Of such a dataset: share of a building's objects to hide.",
)
@click.option("--write-predictions", type=PATH, help="Folder for the predictions of the RUNs.")
@out_option("Folder of the results.  [default: evaluation in the first RUN]")
@resamples_option(200)
@html_option("Also write all results as one HTML page.")
@click.option("--all-metrics", is_flag=True, help="Also print every metric.")
@seed_option()
@force_option
@json_option
def main(runs: tuple[str, ...], all_metrics: bool, as_json: bool, **options: Any) -> None:
    """Measure runs or predictions on a split, beside the baselines.

    A RUN is a folder, or any model that `bsg-belief --model` accepts. A dataset without a split is
    measured whole: give it to models that were trained on other buildings.

    \b
    Example:
      bsg-evaluate run --data dataset --split test
      bsg-evaluate --predictions mine.parquet --data dataset
      bsg-evaluate universal mixture --data elsewhere --mask rooms
    """
    if not runs and not options["predictions"]:
        raise click.UsageError("nothing to measure; give a RUN or --predictions FILE")
    if options["write_predictions"] is not None and not runs:
        raise click.UsageError("--write-predictions writes what a RUN predicts; give a RUN too")
    models = tuple(Path(run) if Path(run).exists() else run for run in runs)
    mask = {name: options.pop(name) for name in ("fraction", "withhold", "parts")}
    recipe = bsg_data.MaskRecipe(strategy=options.pop("mask"), **mask)
    fresh = bsg_data.PairsRecipe(mask=recipe)
    request = bsg_models.EvaluationRequest(runs=models, fresh=fresh, **options)
    with progress_bar("evaluate", unit="building") as progress:
        report = bsg_models.report_evaluation(request, progress=progress)
    comparison = report.comparison
    for note in (*comparison.notes, *report.notes):
        print_note(note)
    if as_json:
        print_json(report.summary)
        return
    names = list(comparison.estimates)
    if comparison.has_verdicts:
        verdicts = bsg_models.explain(comparison.bootstraps, runs=comparison.runs)
        print_text("\n".join(verdicts) + "\n")
    print_text(format_text(bsg_models.headline_rows(comparison), header=["", *names]))
    if all_metrics:
        rows = bsg_models.metric_rows(comparison)
        print_text("\n" + format_text(rows, header=["metric", "nodes", *names]))
    print_text(f"\nall metrics: {report.report}; per class: {report.classes}; figures:")
    print_text("\n".join(f"  {path}  {what}" for what, path in report.figures.items()))
