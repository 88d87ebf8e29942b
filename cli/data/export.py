"""`bsg-data export`: write a dataset in the format of another program."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_data
from bsg_cli.options import RegistryChoice, dataset_argument, force_option, out_option
from bsg_cli.terminal import Command, print_text, progress_bar
from bsg_data.exports.catalogue import EXPORTS


@click.command("export", cls=Command)
@dataset_argument
@click.option("--to", type=RegistryChoice(EXPORTS), required=True, help="Format to write.")
@out_option("Folder to write to. Other files in it stay.", required=True)
@force_option
def export(dataset: Path, to: str, out: Path, force: bool) -> None:
    """Write a dataset in the format of another program.

    graphml and networkx hold building, rooms and objects as one graph; they need networkx
    (the extra train). habitat has the rooms with boxes as habitat-sim's regions.

    table: one <scene>.objects.csv per scene, which `--source table` reads; joined, they
    are one table.

    \b
    Example:
      bsg-data export dataset --to graphml --out graphs
      bsg-data export dataset --to habitat --out regions
    """
    with progress_bar("export", unit="scene") as report:
        done = bsg_data.export_dataset(dataset, out, to=to, force=force, progress=report)
    objects = f" and {done.objects:,} objects" if done.objects else ""
    held = f"{done.rooms:,} rooms{objects} of {done.scenes:,} scenes"
    print_text(f"{held} in {done.files:,} files in {out}")
    if done.rooms_left_out:
        scenes = f", and all of {len(done.left_out):,} scenes" if done.left_out else ""
        print_text(f"rooms left out, because they have no box: {done.rooms_left_out:,}{scenes}")
    for note, scenes_of in done.notes.items():
        print_text(f"{note} ({scenes_of:,} scenes)")
