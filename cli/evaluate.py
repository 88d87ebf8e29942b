"""`bsg-evaluate`: measure runs and predictions with every metric, beside the baselines."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_cli.options import (
    PATH,
    dataset_argument,
    force_option,
    html_option,
    json_option,
    mask_options,
    model_option,
    out_option,
    split_option,
)
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar
from bsg_data.tables import format_text


@click.command("bsg-evaluate", cls=Command)
@dataset_argument
@model_option("A trained run, or a shipped model; may be repeated.", multiple=True)
@split_option("Split to measure on.", default="test")
@click.option(
    "--predictions",
    multiple=True,
    type=PATH,
    help="Predictions of any program (docs/evaluation.md): a parquet file or a folder of them.",
)
@mask_options(
    "Of a dataset without a split, all buildings of which are measured: how to hide objects.",
    "Of such a dataset: share of a building's objects to hide.",
)
@click.option("--write-predictions", type=PATH, help="Folder for the predictions of the models.")
@out_option("Folder of the results.  [default: evaluation in the first run]")
@html_option("Also write all results as one HTML page.")
@force_option
@json_option
def main(model: tuple[str, ...], as_json: bool, **options: Any) -> None:
    """Measure models or predictions on a split of a dataset, beside the baselines.

    A dataset without a split is measured whole: give it to models that were trained on other
    buildings.

    \b
    Example:
      bsg-evaluate dataset --model run
      bsg-evaluate dataset --predictions mine.parquet
      bsg-evaluate elsewhere --model universal --model mixture --mask rooms
    """
    if not model and not options["predictions"]:
        raise click.UsageError("nothing to measure; give --model NAME or --predictions FILE")
    if options["write_predictions"] is not None and not model:
        raise click.UsageError("--write-predictions writes what a model predicts; give --model too")
    # Imported here: a help or a typo must not wait for torch.
    from bsg_models.evaluation.verdict import explain, headline_rows
    from bsg_models.studies.comparison import EvaluationRequest
    from bsg_models.studies.evaluation_report import report_evaluation

    models = tuple(Path(name) if Path(name).exists() else name for name in model)
    recipe = bsg_data.MaskRecipe(strategy=options.pop("mask"), fraction=options.pop("fraction"))
    fresh = bsg_data.PairsRecipe(mask=recipe)
    request = EvaluationRequest(runs=models, fresh=fresh, **options)
    with progress_bar("evaluate", unit="building") as progress:
        report = report_evaluation(request, progress=progress)
    comparison = report.comparison
    for note in (*comparison.notes, *report.notes):
        print_note(note)
    if as_json:
        print_json(report.summary)
        return
    names = list(comparison.estimates)
    if comparison.has_verdicts:
        verdicts = explain(comparison.bootstraps, runs=comparison.runs)
        print_text("\n".join(verdicts) + "\n")
    print_text(format_text(headline_rows(comparison.estimates), header=["", *names]))
    figures = f"figures beside them: {len(report.figures)}"
    print_text(f"\nall metrics: {report.report}; per class: {report.classes}; {figures}")
    if (folder := options["write_predictions"]) is not None:
        print_text(f"predictions in {folder}, by name: {', '.join(comparison.runs)}")
    if options["html"] is None:
        print_text("all on one page: the same command with --html report.html --force")
    else:
        print_text(f"all on one page: {options['html']} (open it in a browser)")
