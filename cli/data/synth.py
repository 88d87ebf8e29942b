"""`bsg-data synth`: write synthetic buildings in the file layout of HM3D."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_cli.choices import MESH_SIZES, MOST_OBJECTS, MOST_ROOMS, MOST_SCENES
from bsg_cli.options import force_option, json_option, out_option, seed_option, workers_option
from bsg_cli.terminal import (
    Command,
    Workers,
    print_json,
    print_text,
    progress_bar,
    worker_pool,
)
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
    "--rooms",
    type=click.IntRange(1, MOST_ROOMS),
    help="Rooms per building, to test large buildings.  [default: as in HM3D]",
)
@click.option(
    "--objects",
    type=click.IntRange(1, MOST_OBJECTS),
    help="Objects in the rooms of each building.  [default: as in HM3D]",
)
@click.option(
    "--geometry",
    is_flag=True,
    help="Also write meshes, and their true geometry in <hash>.truth.json.",
)
@click.option(
    "--size",
    type=click.Choice(MESH_SIZES),
    help="With --geometry: size of the mesh; full is as large as a real one.  [default: small]",
)
@click.option(
    "--coloured-by",
    type=click.Choice(["texture", "vertex", "both"]),
    help="With --geometry: where the mesh has its colours.  [default: texture]",
)
@click.option(
    "--up-axis",
    type=click.Choice(["y", "z"]),
    help="With --geometry: the axis that points up.  [default: y and z in turn]",
)
@seed_option()
@workers_option
@force_option
@json_option
def synth(
    out: Path,
    scenes: int,
    rooms: int | None,
    objects: int | None,
    geometry: bool,
    seed: int,
    workers: Workers,
    force: bool,
    as_json: bool,
    **chosen: Any,
) -> None:
    """Write synthetic buildings in the file layout of HM3D.

    \b
    Example:
      bsg-data synth --out buildings --scenes 20 --seed 0
      bsg-data synth --out places --scenes 5 --geometry
      bsg-data synth --out towers --scenes 1 --rooms 10000
    """
    given = {name: value for name, value in chosen.items() if value is not None}
    if given and not geometry:
        raise click.UsageError(f"--{next(iter(given)).replace('_', '-')} needs --geometry")
    options = extend.GeometryOptions(**given) if geometry else None
    if not (geometry or rooms or objects) and workers.scheduler is None:
        workers = Workers(1)  # for small buildings one process is faster
    pool = worker_pool(workers, writes=[out])
    with pool as executor, progress_bar("synth", unit="scene") as report:
        writing = bsg_data.write_synthetic(
            out,
            scenes=scenes,
            seed=seed,
            size=extend.BuildingSize(rooms, objects),
            geometry=options,
            force=force,
            executor=executor,
        )
        for done, _ in enumerate(writing, 1):
            report(done, scenes)
    if as_json:
        print_json({"out": str(out), "scenes": scenes, "seed": seed, "geometry": geometry})
    else:
        print_text(f"{scenes} synthetic buildings{' with meshes' * geometry} in {out}")
