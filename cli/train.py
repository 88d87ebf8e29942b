"""`bsg-train`: one configuration, one dataset, one run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

import click
from tqdm import tqdm  # noqa: TID251 -- the command line is where bars belong

from bsg_cli.terminal import Command, force_option, json_option, print_json, print_note
from bsg_models.errors import ConfigError
from bsg_models.rendering.figures import plot_learning_curve
from bsg_models.runs.run_folder import BEST, CURVE, MEMBERS, METRICS
from bsg_models.training.learning_curve import EpochReport, read_metrics
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import (
    RunConfig,
    find_config,
    override,
    read_config,
    validate_config,
    write_toml,
)
from bsg_models.zoo.construction import can_resume
from bsg_models.zoo.ensemble import EnsembleConfig


@click.command(cls=Command)
@click.option(
    "--config",
    "config_name",
    required=True,
    help=f"A TOML file, or one of {', '.join(ZOO)}.",
    metavar="NAME|FILE",
)
@click.option("--data", type=click.Path(path_type=Path), help="Dataset, split and with pairs.")
@click.option("--out", type=click.Path(path_type=Path), help="Folder of the run.")
@click.option("--set", "settings", multiple=True, metavar="PATH=VALUE", help="Override one value.")
@click.option("--seed", type=click.IntRange(min=0), help="Short for --set seed=N.")
@click.option("--print-config", is_flag=True, help="Print what would run, and stop.")
@click.option("--resume", is_flag=True, help="Go on with a run that was stopped.")
@click.option("--tensorboard", is_flag=True, help="Log for TensorBoard into the run, too.")
@force_option
@json_option
@click.version_option(package_name="belief-scene-graphs", prog_name="bsg-train")
def main(
    config_name: str,
    data: Path | None,
    out: Path | None,
    settings: tuple[str, ...],
    seed: int | None,
    print_config: bool,
    resume: bool,
    tensorboard: bool,
    force: bool,
    as_json: bool,
) -> None:
    """Train a model of the zoo on a dataset.

    Ctrl-C stops a training; the same command with --resume goes on to the same weights.

    \b
    Example:
      bsg-train --config ceci-gcn --data dataset --out run --set training.epochs=50
    """
    if seed is not None:
        settings = (*settings, f"seed={seed}")
    config = load_config(config_name, settings)
    if print_config:
        click.echo(write_toml(config), nl=False)
        return
    if data is None or out is None:
        raise click.UsageError("--data and --out are needed to train (or give --print-config)")
    try:
        with _board(out if tensorboard else None) as log, _bar(config) as draw:
            trained = 0
            for report in train_run(config, data, out, resume=resume, force=force):
                draw(report)
                log(report)
                trained += 1
    except KeyboardInterrupt:
        reports = _draw_curve(config, out)
        saved = f"saved up to epoch {reports[-1].epoch}" if reports else "nothing is saved yet"
        if isinstance(config.model, EnsembleConfig):
            saved = "finished members are kept"
        again = "with --resume goes on" if can_resume(config) else "starts again"
        print_note(f"{out}: {saved}; the same command {again}")
        raise
    if resume and not trained:
        print_note(f"{out}: is finished already; nothing was trained")
    _finish(config, out, as_json=as_json)


def load_config(name: str, settings: tuple[str, ...]) -> RunConfig:
    """Return the configuration of a zoo name or a TOML file, with its overrides."""
    if name in ZOO or not (name.endswith(".toml") or Path(name).is_file()):
        tables = find_config(name).model_dump(mode="json")
    else:
        tables = read_config(Path(name))
    source = f"--config {name}" + (" with its --set" if settings else "")
    return validate_config(override(tables, settings), source=source)


def _finish(config: RunConfig, out: Path, *, as_json: bool) -> None:
    reports = _draw_curve(config, out)
    best = next((r for r in reports if r.epoch == reports[-1].best_epoch), None)
    summary = {
        "run": str(out),
        "checkpoint": str(out / BEST),
        "epochs": len(reports),
        "best_epoch": best.epoch if best else None,
        "val_loss": best.val_loss if best else None,
        "seconds": round(sum(r.seconds for r in reports), 3),
    }
    if as_json:
        print_json(summary)
    elif isinstance(config.model, EnsembleConfig):
        members = ", ".join(config.model.members)
        click.echo(f"ensemble of {members}; their runs are in {out / MEMBERS}")
        click.echo(f"checkpoint {out / BEST}")
    elif best is None:
        click.echo(f"{config.name} fitted by counting; checkpoint {out / BEST}")
    else:
        click.echo(
            f"{config.name}: {len(reports)} epochs in {summary['seconds']:.1f} s; lowest "
            f"validation loss {best.val_loss:.4f} at epoch {best.epoch}"
        )
        click.echo(f"checkpoint {out / BEST}, learning curve {out / CURVE}")


def _draw_curve(config: RunConfig, out: Path) -> list[EpochReport]:
    """Draw the learning curve of what is saved, and return it; nothing for a model that counts."""
    if not (out / METRICS).is_file():
        return []
    reports = read_metrics(out / METRICS)
    likelihood = getattr(config.model, "likelihood", "mse")
    loss = "mean squared error" if likelihood == "mse" else "-log P(hidden count), mean over cells"
    title = f"{config.name}, seed {config.seed}"
    plot_learning_curve(reports, out / CURVE, title=title, loss=loss)
    return reports


@contextmanager
def _bar(config: RunConfig) -> Iterator[Callable[[EpochReport], None]]:
    """Yield what draws a bar with the losses and the time left on stderr, if that is a terminal."""
    with tqdm(desc=config.name, unit="epoch", disable=None, leave=False) as bar:
        val = "-"

        def draw(report: EpochReport) -> None:
            nonlocal val
            if report.val_loss is not None:
                val = f"{report.val_loss:.3f}"
            bar.total = report.epochs
            bar.set_postfix_str(
                f"train {report.train_loss:.3f}, val {val}, best @{report.best_epoch}",
                refresh=False,
            )
            bar.update(report.epoch - bar.n)

        yield draw


@contextmanager
def _board(run: Path | None) -> Iterator[Callable[[EpochReport], None]]:
    """Yield what logs for TensorBoard, or nothing that does nothing."""
    if run is None:
        yield lambda report: None
        return
    try:
        from torch.utils.tensorboard import SummaryWriter
    except ImportError as error:
        raise ConfigError(
            "--tensorboard needs tensorboard: pip install 'belief-scene-graphs[all]'"
        ) from error
    writer = SummaryWriter(str(run / "tensorboard"))
    print_note(f"TensorBoard: tensorboard --logdir {run / 'tensorboard'}")

    def log(report: EpochReport) -> None:
        writer.add_scalar("loss/train", report.train_loss, report.epoch)
        if report.val_loss is not None:
            writer.add_scalar("loss/val", report.val_loss, report.epoch)

    try:
        yield log
    finally:
        writer.close()
