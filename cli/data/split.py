"""`bsg-data split`: assign buildings to train, val and test, or to folds."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import click

import bsg_data
from bsg_cli.options import dataset_argument, force_option, seed_option
from bsg_cli.terminal import Command, print_text


@click.command("split", cls=Command)
@dataset_argument
@click.option(
    "--ratios",
    type=float,
    nargs=3,
    metavar="TRAIN VAL TEST",
    help="Three fractions that add up to 1.  [default: 0.8 0.1 0.1]",
)
@click.option(
    "--official",
    is_flag=True,
    help="Use the source's val split as test, and 10 % of its train split as val.",
)
@click.option("--folds", type=click.IntRange(min=3), help="Number of folds, for cross-validation.")
@seed_option
@force_option
def split(
    dataset: Path,
    ratios: tuple[float, float, float] | None,
    official: bool,
    folds: int | None,
    seed: int,
    force: bool,
) -> None:
    """Assign every building to train, val or test, or to a fold.

    \b
    Example:
      bsg-data split dataset --ratios 0.8 0.1 0.1 --seed 0
    """
    if (ratios is not None) + (folds is not None) + official > 1:
        raise click.UsageError(
            "--ratios, --official and --folds exclude each other; give one of them"
        )
    chosen: dict[str, Any] = {"ratios": ratios or (0.8, 0.1, 0.1)}
    if official:
        chosen = {"method": "official", "ratios": (0.9, 0.1, 0.0)}
    elif folds is not None:
        chosen = {"method": "folds", "ratios": None, "folds": folds}
    recipe = bsg_data.SplitRecipe(seed=seed, **chosen)
    bsg_data.split_dataset(dataset, recipe, force=force)
    splits = bsg_data.read_splits(dataset)
    sizes = {name: len(ids) for name, ids in splits.items()}
    print_text(", ".join(f"{name} {size}" for name, size in sizes.items()) + " buildings")
    print_text(f"next: bsg-data pairs {dataset}")
