"""`bsg-train`: train one model on one dataset."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING

import click

import bsg_data
from bsg_cli.choices import complete_names_or_files, load_run
from bsg_cli.data.totals import warn_of_recordings
from bsg_cli.options import PATH, force_option, out_option, require_datasets
from bsg_cli.terminal import Command, print_note, print_text, progress_bar
from bsg_data.files import resolve_links
from bsg_data.places import BUILD
from bsg_data.recipes import MaskRecipe
from bsg_data.results import name_staged
from bsg_models.zoo.catalogue import RECIPES, ZOO

if TYPE_CHECKING:
    from bsg_models.runs.run_folder import EpochReport
    from bsg_models.zoo.config import RunConfig


@click.command("bsg-train", cls=Command)
@click.argument(
    "dataset", type=PATH, required=False, callback=require_datasets, metavar="[DATASET]"
)
@click.option(
    "--config",
    "config_name",
    required=True,
    help=f"What to train: a TOML file, or one of {', '.join((*RECIPES, *ZOO))}.",
    metavar="NAME|FILE",
    shell_complete=complete_names_or_files(lambda: (*RECIPES, *ZOO)),
)
@out_option("Folder of the run; by default `out` of the file.")
@click.option(
    "--set",
    "settings",
    multiple=True,
    metavar="PATH=VALUE",
    help="Override one value of the configuration; may be repeated.",
)
@click.option("--seed", type=click.IntRange(min=0), help="Short for --set seed=N.")
@click.option(
    "--print", "prints", is_flag=True, help="Print the configuration and exit; needs no DATASET."
)
@force_option
def main(
    dataset: Path | None,
    config_name: str,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    prints: bool,
    force: bool,
) -> None:
    """Train a model of the zoo on a dataset that has a split and pairs.

    After an interruption, run the same command again to continue; the weights will be the same as
    without it.

    `dataset` and `out` may stand at the top of a TOML file: paths, from the working directory. What
    the command line says goes first.

    \b
    Example:
      bsg-train dataset --config quick --out run
      bsg-train --config paper --print
      bsg-train --config mine.toml
    """
    if seed is not None:
        settings = (*settings, f"seed={seed}")
    config, own_dataset, own_out = load_run(config_name, settings)
    if prints:
        from bsg_models.zoo.config import write_toml

        print_text(write_toml(config), nl=False)
        return
    dataset, out = dataset or own_dataset, out or own_out
    if dataset is None or out is None:
        raise click.UsageError(
            "expected DATASET and --out, or `dataset` and `out` at the top of the file that "
            "--config names; --print alone needs neither"
        )
    _note_other_mask(config, dataset)
    # Imported here, as in the other commands: a help or a typo must not wait for torch.
    from bsg_models.training.training import train_run

    try:
        with _bar(config) as draw:
            train_run(config, dataset, out, force=force, progress=draw)
    except KeyboardInterrupt:
        partial = name_staged(resolve_links(out))
        if any((partial / BUILD).glob("*.safetensors")):
            print_note(f"{partial}: the same command goes on with this training")
        raise
    print_run(out)
    print_text(f"next: bsg-evaluate {dataset} --model {out}")


def _note_other_mask(config: RunConfig, dataset: Path) -> None:
    """Print a note if a model trains under another mask than that of the stored pairs."""
    manifest, choice = bsg_data.read_manifest(dataset), config.data
    warn_of_recordings(manifest)
    pairs = manifest.pairs
    if pairs is None:
        return
    fresh, stored = choice.mask, pairs.mask
    if choice.masks == "fixed":
        if choice.fractions or fresh not in (stored, MaskRecipe()):
            print_note(
                f"data.masks is fixed: trains on the pairs of {dataset}, with masks {stored}; "
                "data.mask and data.fractions are for data.masks=fresh"
            )
    elif choice.fractions is None and str(fresh) != str(stored):
        own = choice.needs_own_masks(stored)
        print_note(
            f"trains {'and validates ' if own else ''}on masks {fresh} (data.mask of the "
            f"configuration), and tests on the pairs of {dataset}, with masks {stored}"
        )


def print_run(run: Path) -> None:
    """Print what a run is, and how good its best epoch was."""
    from bsg_models.runs.checkpoint import read_header
    from bsg_models.runs.checkpoint_file import BEST
    from bsg_models.runs.run_folder import CURVE, list_outdated, read_record

    checkpoint, curve = run / BEST, run / CURVE
    header, record = read_header(checkpoint), read_record(run)
    config = header.config
    if header.members:
        print_text(f"ensemble of {', '.join(header.members)}; checkpoint {checkpoint}")
    elif header.val_loss is None:
        print_text(f"{config.name} fitted by counting; checkpoint {checkpoint}")
    else:
        limit = "at most " if config.training.patience else ""
        took = f" in {record.seconds:.1f} s" if record else ""
        print_text(
            f"{config.name}: {limit}{config.training.epochs} epochs{took}; lowest validation loss "
            f"{header.val_loss:.4f} at epoch {header.epoch}"
        )
        drawn = f", learning curve {curve}" if curve.is_file() else ""
        print_text(f"checkpoint {checkpoint}{drawn}")
    for note in record.notes if record else ():
        print_note(note)
    for folder in list_outdated(run):
        print_note(f"note: {folder} measures other weights than {checkpoint}; measure it again")


@contextmanager
def _bar(config: RunConfig) -> Iterator[Callable[[EpochReport], None]]:
    """Yield a callback that draws a bar with epochs and losses."""
    with progress_bar(config.name, unit="epoch") as progress:
        val = "-"

        def draw(report: EpochReport) -> None:
            nonlocal val
            if report.val_loss is not None:
                val = f"{report.val_loss:.3f}"
            losses = f"train {report.train_loss:.3f}, val {val}, best @{report.best_epoch}"
            progress(report.epoch, report.epochs, losses)

        yield draw
