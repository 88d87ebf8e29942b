"""`bsg-data`: build, split, mask, check and export datasets."""

from __future__ import annotations

import click

from bsg_cli.data.build import build, merge
from bsg_cli.data.export import export
from bsg_cli.data.info import check, info
from bsg_cli.data.map import class_maps
from bsg_cli.data.pairs import pairs
from bsg_cli.data.split import split
from bsg_cli.data.synth import synth
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


# in working order
for command in (synth, build, split, pairs, check, info, class_maps, merge, export):
    main.add_command(command)
