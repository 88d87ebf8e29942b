"""`bsg-data`: build, split, mask, check and export datasets."""

from __future__ import annotations

import click

from bsg_cli.data import (
    build,
    check,
    export,
    finalise,
    info,
    map,  # noqa: A004
    merge,
    pairs,
    split,
    synth,
)
from bsg_cli.terminal import CommandGroup


@click.group("bsg-data", cls=CommandGroup)
def main() -> None:
    """Turn annotations of HM3D and other sources into datasets of 3D scene graphs.

    \b
    Example:
      bsg-data synth --out buildings --scenes 20
      bsg-data build --hm3d buildings --out dataset
      bsg-data split dataset
      bsg-data pairs dataset
      bsg-data check dataset
    """


# in working order, as the cheat sheet has them
for module in (synth, build, finalise, split, pairs, check, info, map, merge, export):
    main.add_command(module.command)
