"""Summarise a run: what was trained, how well, and what in its folder is of other weights."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from bsg_data.files import AnyPath
from bsg_data.seal import require_seal
from bsg_models.runs.checkpoint import CheckpointHeader, read_header
from bsg_models.runs.run_folder import BEST, CONFIG, CURVE, TrainingRecord, read_record
from bsg_models.studies.sealed_results import list_of_other_weights


@dataclass(frozen=True, slots=True)
class RunSummary:
    """A run in short."""

    run: Path  # its folder
    header: CheckpointHeader  # of its checkpoint: configuration, dataset, best epoch
    record: TrainingRecord | None  # how its training went; None if it does not say
    # folders in the run with an evaluation or a search of other weights
    outdated: tuple[Path, ...] = ()

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
    def notes(self) -> tuple[str, ...]:
        """What the training left out, and what is outdated."""
        outdated = (
            f"note: {folder} measures other weights than {self.checkpoint}; measure the run again "
            "with --force"
            for folder in self.outdated
        )
        return (*(self.record.notes if self.record else ()), *outdated)


def summarise_run(run: AnyPath) -> RunSummary:
    """Return what a run is and how its training went.

    Raises:
        CheckpointError: if there is no run.
        TrainingError: if its record is damaged.
        DatasetError: if one of its files was changed.
    """
    run = Path(run)
    require_seal(run)
    return RunSummary(run, read_header(run / BEST), read_record(run), list_of_other_weights(run))
