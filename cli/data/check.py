"""`bsg-data check`: check a dataset in full."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_data
from bsg_cli.options import dataset_argument, json_option
from bsg_cli.terminal import Command, print_json, print_note, print_text, progress_bar


@click.command("check", cls=Command)
@dataset_argument
@json_option
def command(dataset: Path, as_json: bool) -> None:
    """Check hashes, schemas, keys, counts, splits and masks of a dataset.

    \b
    Example:
      bsg-data check dataset
    """
    with progress_bar("check", unit="file") as report:
        faults = bsg_data.check_dataset(dataset, progress=report)
    if as_json:
        print_json(
            {"sound": not faults, "faults": [{"where": f.where, "what": f.what} for f in faults]}
        )
    elif faults:
        print_text("\n".join(f"{fault.where}: {fault.what}" for fault in faults))
    else:
        print_text(f"{dataset}: sound")
    if faults:
        print_note(
            f"faults: {len(faults)}; repair: run an interrupted command again, copy a damaged file "
            "from another copy, or write it again with --force"
        )
        raise click.exceptions.Exit(1)
