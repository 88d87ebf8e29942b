"""`bsg-data pairs`: draw masks, and write input and target histograms."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_cli.data.totals import warn_of_recordings
from bsg_cli.options import (
    dataset_argument,
    force_option,
    mask_options,
    number_option,
    seed_option,
    workers_option,
)
from bsg_cli.terminal import Command, print_note, print_text, progress_bar, worker_pool
from bsg_data import extend


@click.command("pairs", cls=Command)
@dataset_argument
@mask_options(
    "How to hide objects.",
    "Share of a building's objects to hide; under tour, of its rooms to find.",
)
@click.option(
    "--withhold",
    type=click.FloatRange(0, 1),
    default=0.0,
    show_default=True,
    help="Share of the classes to hide everywhere except in searched rooms.",
)
@click.option(
    "--hide-parts",
    is_flag=True,
    help="Hide the parts of hidden objects: the curtain rod of a hidden curtain.",
)
@click.option(
    "--rooms",
    type=click.IntRange(min=1),
    help="With --mask tour: number of rooms that were found, instead of --fraction of them.",
)
@number_option("--draws", "Masks per building.", default=10)
@seed_option
@workers_option
@force_option
def pairs(
    dataset: Path, draws: int, workers: int, force: bool, hide_parts: bool, **mask: Any
) -> None:
    """Draw masks and write input and target histograms.

    \b
    Example:
      bsg-data pairs dataset --mask uniform --fraction 0.5 --draws 10
      bsg-data pairs dataset --mask explore --withhold 0.2 --force
      bsg-data pairs dataset --mask tour --rooms 3 --force
    """
    mask |= {"strategy": mask.pop("mask"), "parts": hide_parts}
    recipe = bsg_data.PairsRecipe(mask=bsg_data.MaskRecipe.model_validate(mask), draws=draws)
    with worker_pool(workers) as executor, progress_bar("pairs", unit="file") as report:
        how: Any = {"force": force, "executor": executor, "progress": report}
        manifest = bsg_data.write_pairs(dataset, recipe, **how)
    is_recorded = warn_of_recordings(manifest)
    data = bsg_data.Dataset.open(dataset)
    rows = sum(entry.rows for entry in manifest.files_of("pairs"))
    if extend.MASKS[recipe.mask.strategy].reads_connections:
        bare = data.count_unconnected()
        if bare:
            print_note(
                f"{bare:,} of {manifest.totals.scenes:,} scenes have no adjacency; there all rooms "
                "count as neighbours, on a tour those that are near in the list"
            )
    hashes = extend.hash_splits(data)
    print_text(f"{rows:,} pairs: {draws} draws of the mask {recipe.mask}")
    print_text(f"sha256 of all masks: {hashes['all']}")
    if not is_recorded:
        print_text(f"next: bsg-train {dataset} --config quick --out run")
