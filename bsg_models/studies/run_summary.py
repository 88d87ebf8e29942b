"""What a training left in its run, in short, with its learning curve drawn."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bsg_models.rendering.figures import plot_learning_curve
from bsg_models.runs.run_folder import BEST, CURVE, MEMBERS, METRICS
from bsg_models.training.learning_curve import EpochReport, read_metrics
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.construction import can_resume
from bsg_models.zoo.ensemble import EnsembleConfig


@dataclass(frozen=True, slots=True)
class RunSummary:
    """A run in short.

    Attributes:
        run: its folder.
        config: that it was trained by.
        epochs: that were trained; 0 for a model that is fitted by counting.
        last: epoch that was saved last; None without epochs.
        best: the epoch with the lowest validation loss; None without epochs.
        seconds: that the epochs took.
    """

    run: Path
    config: RunConfig
    epochs: int
    last: EpochReport | None
    best: EpochReport | None
    seconds: float

    @property
    def model(self) -> str:
        """The name of the model."""
        return self.config.name

    @property
    def members(self) -> tuple[str, ...]:
        """The members of an ensemble."""
        return self.config.model.members if isinstance(self.config.model, EnsembleConfig) else ()

    @property
    def folder(self) -> Path:
        """The folder with the runs of an ensemble's members."""
        return self.run / MEMBERS

    @property
    def checkpoint(self) -> Path:
        """The best checkpoint."""
        return self.run / BEST

    @property
    def curve(self) -> Path:
        """The figure of the learning curve."""
        return self.run / CURVE

    @property
    def saved(self) -> str:
        """What a training that was stopped has saved."""
        if self.members:
            return "finished members are kept"
        return f"saved up to epoch {self.last.epoch}" if self.last else "nothing is saved yet"

    @property
    def again(self) -> str:
        """What the same training does when it runs again."""
        return "with --resume goes on" if can_resume(self.config) else "starts again"

    def encode(self) -> dict[str, Any]:
        """Return the summary, ready for JSON."""
        return {
            "run": str(self.run),
            "checkpoint": str(self.checkpoint),
            "epochs": self.epochs,
            "best_epoch": self.best.epoch if self.best else None,
            "val_loss": self.best.val_loss if self.best else None,
            "seconds": self.seconds,
        }


def summarise_run(config: RunConfig, run: Path) -> RunSummary:
    """Return what a training has saved so far, and draw its learning curve."""
    reports = _plot_curve(config, run)
    last = reports[-1] if reports else None
    best = next((r for r in reports if last and r.epoch == last.best_epoch), None)
    seconds = round(sum(report.seconds for report in reports), 3)
    return RunSummary(run, config, len(reports), last, best, seconds)


def _plot_curve(config: RunConfig, run: Path) -> list[EpochReport]:
    """Plot the learning curve, and return it; nothing for a model that counts."""
    if not (run / METRICS).is_file():
        return []
    reports = read_metrics(run / METRICS)
    likelihood = getattr(config.model, "likelihood", "mse")
    loss = "mean squared error" if likelihood == "mse" else "-log P(hidden count), mean over cells"
    title = f"{config.name}, seed {config.seed}"
    plot_learning_curve(reports, run / CURVE, title=title, loss=loss)
    return reports
