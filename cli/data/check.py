"""`bsg-data check`: proof that a dataset is sound."""

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
    """Prove that a dataset is sound: hashes, schemas, keys, counts, splits, masks.

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
            f"faults: {len(faults)}; a command that was stopped removes what it left when it runs "
            "again; take a damaged file from another copy, or make it again with --force"
        )
        raise click.exceptions.Exit(1)
