"""`bsg-data finalise`: finish a dataset that was built in parts."""

from __future__ import annotations

from pathlib import Path

import click

from bsg_cli.data.totals import format_losses, format_totals
from bsg_cli.options import PATH, force_option, json_option
from bsg_cli.terminal import Command, print_json, print_text, progress_bar
from bsg_data import extend


@click.command("finalise", cls=Command)
@click.argument("dataset", type=PATH, metavar="DATASET")
@force_option
@json_option
def command(dataset: Path, force: bool, as_json: bool) -> None:
    """Finish a dataset that `bsg-data build --parts` built.

    Every file is compared with the report of its part. If a file is missing or damaged, the error
    names the part to run again. The bytes equal those of a build without parts.

    \b
    Example:
      bsg-data finalise dataset
    """
    with progress_bar("finalise", unit="shard") as report:
        manifest = extend.finalise_dataset(dataset, force=force, progress=report)
    if as_json:
        print_json(manifest.model_dump(mode="json", exclude={"files"}))
        return
    print_text(format_totals(manifest))
    print_text(format_losses(manifest))
    print_text(f"dataset in {dataset}")
