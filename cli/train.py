"""`bsg-train`: train one model on one dataset."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import click

import bsg_data
import bsg_models
from bsg_cli.choices import MODELS, complete_names_or_files, load_config
from bsg_cli.data.totals import warn_of_recordings
from bsg_cli.options import PATH, force_option, out_option, require_datasets
from bsg_cli.terminal import Command, print_note, print_text, progress_bar
from bsg_data.errors import BSGError
from bsg_data.results import SEAL, read_seal


@click.command("bsg-train", cls=Command)
@click.argument("dataset", type=PATH, required=False, callback=require_datasets, metavar="DATASET")
@click.option(
    "--config",
    "config_name",
    required=True,
    help=f"Model to train: a TOML file, or one of {', '.join(MODELS)}.",
    metavar="NAME|FILE",
    shell_complete=complete_names_or_files(lambda: MODELS),
)
@out_option("Folder of the run.")
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
@click.option("--resume", is_flag=True, help="Continue an interrupted run.")
@force_option
def main(
    dataset: Path | None,
    config_name: str,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    prints: bool,
    resume: bool,
    force: bool,
) -> None:
    """Train a model of the zoo on a dataset that has a split and pairs.

    Ctrl-C stops the training. Run the same command with --resume to continue; the weights will be
    the same as without the stop.

    \b
    Example:
      bsg-train dataset --config ceci-gcn --out run --set training.epochs=50
      bsg-train --config ceci-gcn --print
    """
    if seed is not None:
        settings = (*settings, f"seed={seed}")
    config = load_config(config_name, settings)
    if prints:
        print_text(bsg_models.write_toml(config), nl=False)
        return
    if dataset is None or out is None:
        raise click.UsageError("expected DATASET and --out; --print alone needs neither")
    _note_other_mask(config, dataset)
    before = _seal_of(out) if resume else None
    try:
        with _bar(config) as draw:
            trained = 0
            for report in bsg_models.train_run(config, dataset, out, resume=resume, force=force):
                draw(report)
                trained += 1
    except KeyboardInterrupt:
        _note_stopped(out)
        raise
    if before and not trained and _seal_of(out) == before:
        print_note(f"{out}: the run is finished already; nothing was trained")
    for note in bsg_models.plot_run(out):
        print_note(note)
    print_run(bsg_models.summarise_run(out))
    print_text(f"next: bsg-evaluate {dataset} --model {out}")


def _note_other_mask(config: bsg_models.RunConfig, dataset: Path) -> None:
    """Print a note if a model trains under another mask than that of the stored pairs."""
    manifest, choice = bsg_data.read_manifest(dataset), config.data
    warn_of_recordings(manifest)
    pairs = manifest.pairs
    if pairs is None or choice.masks == "fixed" or choice.fractions is not None:
        return
    fresh, stored = choice.fresh_mask, pairs.mask
    if choice.needs_own_masks(stored):
        print_note(
            f"trains and validates on fresh masks {fresh} (data.mask of the configuration); tests "
            f"on the pairs of {dataset}, with masks {stored}"
        )
    elif str(fresh) != str(stored):
        print_note(
            f"trains on masks {fresh} (data.mask of the configuration); validates on the pairs of "
            f"{dataset}, with masks {stored}"
        )


def _seal_of(run: Path) -> dict[str, str] | None:
    """Return the seal of a run; None if it has no readable seal."""
    with suppress(BSGError):
        return read_seal(run)
    return None


def _note_stopped(run: Path) -> None:
    """Print what an interrupted training has saved, if it began."""
    if (run / SEAL).is_file():
        print_note(f"{run}: the earlier run is unchanged; --resume goes on with the new one")
        return
    with suppress(BSGError):
        bsg_models.plot_run(run)
        summary = bsg_models.summarise_run(run)
        print_note(f"{run}: {summary.saved}; the same command {summary.again}")


def print_run(summary: bsg_models.RunSummary) -> None:
    """Print what a run is, and how good its best epoch was."""
    best = summary.best
    if summary.members:
        print_text(f"ensemble of {', '.join(summary.members)}; their runs are in {summary.folder}")
        print_text(f"checkpoint {summary.checkpoint}")
    elif best is None:
        print_text(f"{summary.config.name} fitted by counting; checkpoint {summary.checkpoint}")
    else:
        print_text(
            f"{summary.config.name}: {summary.epochs} epochs in {summary.seconds:.1f} s; lowest "
            f"validation loss {best.val_loss:.4f} at epoch {best.epoch}"
        )
        curve = f", learning curve {summary.curve}" if summary.curve.is_file() else ""
        print_text(f"checkpoint {summary.checkpoint}{curve}")
    for note in summary.notes:
        print_note(note)


@contextmanager
def _bar(config: bsg_models.RunConfig) -> Iterator[Callable[[bsg_models.EpochReport], None]]:
    """Yield a callback that draws a bar with epochs and losses."""
    with progress_bar(config.name, unit="epoch") as progress:
        val = "-"

        def draw(report: bsg_models.EpochReport) -> None:
            nonlocal val
            if report.val_loss is not None:
                val = f"{report.val_loss:.3f}"
            losses = f"train {report.train_loss:.3f}, val {val}, best @{report.best_epoch}"
            progress(report.epoch, report.epochs, losses)

        yield draw
