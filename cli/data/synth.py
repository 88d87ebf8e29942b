"""`bsg-data synth`: write synthetic buildings in the file layout of HM3D."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_data
from bsg_cli.options import force_option, number_option, out_option, seed_option
from bsg_cli.terminal import Command, print_text, progress_bar


@click.command("synth", cls=Command)
@out_option("Folder to write.", required=True)
@number_option("--scenes", "Number of buildings.", default=20)
@seed_option
@force_option
def synth(out: Path, scenes: int, seed: int, force: bool) -> None:
    """Write synthetic buildings as HM3D has them, and a room layout of each.

    \b
    Example:
      bsg-data synth --out buildings --scenes 20 --seed 0
      bsg-data build --hm3d buildings --room-layouts buildings/layouts --out dataset
    """
    with progress_bar("synth", unit="scene") as report:
        writing = bsg_data.write_synthetic(out, scenes=scenes, seed=seed, force=force)
        for done, _ in enumerate(writing, 1):
            report(done, scenes)
    print_text(f"{scenes:,} synthetic buildings in {out}")
    print_text(f"next: bsg-data build --hm3d {out} --room-layouts {out / 'layouts'} --out dataset")
