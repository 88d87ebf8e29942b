"""`bsg-data merge`: merge datasets into one."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_data
from bsg_cli.data.totals import format_sources, format_totals
from bsg_cli.options import DatasetPath, force_option, json_option, out_option
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar


@click.command("merge", cls=Command)
@click.argument(
    "datasets", type=DatasetPath(), nargs=-1, required=True, metavar="DATASET DATASET ..."
)
@out_option("Dataset to write.", required=True)
@force_option
@json_option
def command(datasets: tuple[Path, ...], out: Path, force: bool, as_json: bool) -> None:
    """Merge datasets of one class space into one.

    Rows keep their source. Splits and pairs are not copied: make them again.

    \b
    Example:
      bsg-data merge hm3d behavior --out both
    """
    if len(datasets) < 2:
        raise click.UsageError("expected two or more datasets, found 1")
    with progress_bar("merge", unit="scene") as report:
        manifest = bsg_data.merge_datasets(datasets, out, force=force, progress=report)
    if any(bsg_data.read_manifest(dataset).split is not None for dataset in datasets):
        print_note(f"splits and pairs were not copied; next: bsg-data split {out}")
    if as_json:
        print_json(manifest.model_dump(mode="json", exclude={"files"}))
        return
    print_text(format_totals(manifest))
    print_text(f"\n{format_sources(out)}\n")
    print_text(f"dataset in {out}")
