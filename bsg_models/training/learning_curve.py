"""Record the result of every epoch of a training, as CSV."""

from __future__ import annotations

import csv
import io
from pathlib import Path

from bsg_data.recipes import Record
from bsg_models.errors import TrainingError


class EpochReport(Record):
    """The result of one epoch."""

    epoch: int  # counted from 1
    epochs: int  # of the whole training
    train_loss: float  # mean over the epoch's steps
    val_loss: float | None = None  # validation loss; None if this epoch was not validated
    best_epoch: int  # epoch with the lowest val_loss so far
    seconds: float  # that the epoch took


def encode_metrics(rows: list[EpochReport]) -> bytes:
    """Return reports as CSV."""
    text = io.StringIO()
    writer = csv.DictWriter(text, list(EpochReport.model_fields), lineterminator="\n")
    writer.writeheader()
    writer.writerows({**row.model_dump(), "seconds": f"{row.seconds:.4f}"} for row in rows)
    return text.getvalue().encode()


def read_metrics(path: Path) -> list[EpochReport]:
    """Read the output of `encode_metrics`."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = [
                {name: value for name, value in row.items() if value}
                for row in csv.DictReader(file)
            ]
        return [EpochReport.model_validate_strings(row) for row in rows]
    except (OSError, ValueError, TypeError, csv.Error) as error:
        raise TrainingError(f"{path}: not the metrics of a run ({error})") from error
