"""`bsg-data synth`: write synthetic buildings in the file layout of HM3D."""

from __future__ import annotations

from pathlib import Path

import click

import bsg_data
from bsg_cli.choices import MOST_SCENES
from bsg_cli.options import force_option, out_option, seed_option, workers_option
from bsg_cli.terminal import Command, print_text, progress_bar, worker_pool
from bsg_data import extend


@click.command("synth", cls=Command)
@out_option("Folder to write.", required=True)
@click.option(
    "--scenes",
    type=click.IntRange(1, MOST_SCENES),
    default=20,
    show_default=True,
    help="Number of buildings.",
)
@click.option(
    "--geometry",
    is_flag=True,
    help="Also write meshes, and their true geometry in <hash>.truth.json.",
)
@seed_option()
@workers_option
@force_option
def synth(out: Path, scenes: int, geometry: bool, seed: int, workers: int, force: bool) -> None:
    """Write synthetic buildings in the file layout of HM3D.

    \b
    Example:
      bsg-data synth --out buildings --scenes 20 --seed 0
      bsg-data synth --out places --scenes 5 --geometry
    """
    # Without meshes, one process is faster.
    with (
        worker_pool(workers if geometry else 1) as executor,
        progress_bar("synth", unit="scene") as report,
    ):
        writing = bsg_data.write_synthetic(
            out,
            scenes=scenes,
            seed=seed,
            geometry=extend.GeometryOptions() if geometry else None,
            force=force,
            executor=executor,
        )
        for done, _ in enumerate(writing, 1):
            report(done, scenes)
    print_text(f"{scenes:,} synthetic buildings{' with meshes' * geometry} in {out}")
    print_text(f"next: bsg-data build --hm3d {out} --out dataset")
