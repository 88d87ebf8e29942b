"""`bsg-data upgrade`: rewrite a dataset of an earlier format version."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_data
from bsg_cli.options import dataset_argument, json_option
from bsg_cli.terminal import Command, print_json, print_text, progress_bar


@click.command("upgrade", cls=Command)
@dataset_argument
@json_option
def command(dataset: Path, as_json: bool) -> None:
    """Rewrite a dataset of format version 1 as version 2.

    Split and pairs stay the same. The old dataset stays until the new one is complete.

    \b
    Example:
      bsg-data upgrade dataset
    """
    before = bsg_data.read_manifest(dataset).format_version
    with progress_bar("upgrade", unit="scene") as report:
        manifest = bsg_data.upgrade_dataset(dataset, progress=report)
    now = manifest.format_version
    if as_json:
        print_json({"before": before, "now": now})
    elif before == now:
        print_text(f"{dataset}: is of format version {now} already; nothing to do")
    else:
        print_text(f"{dataset}: upgraded from format version {before} to {now}")
