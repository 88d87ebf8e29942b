"""Summarise the trainings of a run, and draw its learning curve."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

from bsg_data.files import AnyPath, noting_failures
from bsg_data.results import require_seal
from bsg_models.errors import CheckpointError, ConfigError
from bsg_models.rendering.figures import plot_learning_curve
from bsg_models.runs.checkpoint import read_header
from bsg_models.runs.run_folder import BEST, CONFIG, CURVE, MEMBERS, METRICS, add_curve
from bsg_models.runs.run_log import Begun, Ended, read_log
from bsg_models.studies.sealed_results import list_of_other_weights
from bsg_models.training.learning_curve import EpochReport, read_metrics
from bsg_models.zoo.config import RunConfig, read_config, validate_config
from bsg_models.zoo.ensemble import EnsembleConfig, can_resume


@dataclass(frozen=True, slots=True)
class RunSummary:
    """A run in short."""

    run: Path  # its folder
    config: RunConfig  # its configuration
    epochs: int  # number trained; 0 for a model that is fitted by counting
    last: EpochReport | None  # epoch that was saved last; None without epochs
    best: EpochReport | None  # epoch with the lowest validation loss; None without epochs
    seconds: float  # that the epochs took
    # every training of the run, the oldest first; empty if no log was kept
    log: tuple[Begun | Ended, ...]
    # folders in the run with an evaluation or a search of other weights
    outdated: tuple[Path, ...] = ()

    @property
    def members(self) -> tuple[str, ...]:
        """Members of an ensemble."""
        return self.config.model.members if isinstance(self.config.model, EnsembleConfig) else ()

    @property
    def folder(self) -> Path:
        """Folder with the runs of an ensemble's members."""
        return self.run / MEMBERS

    @property
    def checkpoint(self) -> Path:
        """The best checkpoint."""
        return self.run / BEST

    @property
    def curve(self) -> Path:
        """Figure of the learning curve."""
        return self.run / CURVE

    @property
    def written_config(self) -> Path:
        """Configuration as TOML; `bsg-train --config` repeats the training with it."""
        return self.run / CONFIG

    @property
    def saved(self) -> str:
        """What a stopped training has saved, in words."""
        if self.members:
            return "finished members are kept"
        return f"saved up to epoch {self.last.epoch}" if self.last else "nothing is saved yet"

    @property
    def again(self) -> str:
        """What happens if the same training is started again, in words."""
        return "with --resume goes on" if can_resume(self.config) else "starts again"

    @property
    def trainings(self) -> tuple[tuple[Begun, Ended | None], ...]:
        """When each training began and how it ended; None as the end of one killed or running."""
        return tuple(
            (begun, ended if isinstance(ended, Ended) else None)
            for begun, ended in pairwise((*self.log, None))
            if isinstance(begun, Begun)
        )

    @property
    def notes(self) -> tuple[str, ...]:
        """What the last training left out, unless it was killed or is running; what is outdated."""
        ended = self.trainings[-1][1] if self.trainings else None
        outdated = (
            f"note: {folder} measures other weights than {self.checkpoint}; measure the run again "
            "with --force"
            for folder in self.outdated
        )
        return (*(ended.notes if ended else ()), *outdated)


def summarise_run(run: AnyPath) -> RunSummary:
    """Return what trainings have saved so far in a run, without writing anything.

    Raises:
        CheckpointError: if there is no run.
        TrainingError: if its log or its metrics are damaged.
        DatasetError: if a file of a finished run was changed.
    """
    run = Path(run)
    require_seal(run)
    config = _config_of(run)
    reports = read_metrics(run / METRICS) if (run / METRICS).is_file() else []
    last = reports[-1] if reports else None
    best = next((r for r in reports if last and r.epoch == last.best_epoch), None)
    seconds = round(sum(report.seconds for report in reports), 3)
    outdated = list_of_other_weights(run)
    return RunSummary(run, config, len(reports), last, best, seconds, read_log(run), outdated)


def plot_run(run: AnyPath) -> tuple[str, ...]:
    """Plot the learning curve of a run into its folder, unless the model is fitted by counting.

    Returns:
        A note if the curve cannot be drawn.
    """
    run = Path(run)
    notes: list[str] = []
    if not (run / METRICS).is_file():
        return ()
    config, reports = _config_of(run), read_metrics(run / METRICS)
    likelihood = getattr(config.model, "likelihood", "mse")
    loss = "mean squared error" if likelihood == "mse" else "-log P(hidden count), mean over cells"
    title = f"{config.name}, seed {config.seed}"
    with add_curve(run) as curve, noting_failures(notes):
        plot_learning_curve(reports, curve, title=title, loss=loss)
    return tuple(notes)


def _config_of(run: Path) -> RunConfig:
    """Return the configuration of a run; if it kept none, that of its checkpoint."""
    if (run / CONFIG).is_file():
        try:
            return validate_config(read_config(run / CONFIG), source=str(run / CONFIG))
        except ConfigError as error:  # the caller asked for no configuration: the file was changed
            raise CheckpointError(str(error)) from error
    if not (run / BEST).is_file():
        raise CheckpointError(f"{run}: no run there: it has neither {CONFIG} nor {BEST}")
    return read_header(run / BEST).config
