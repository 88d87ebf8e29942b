"""Record the result of every epoch of a training, as CSV."""

from __future__ import annotations

import csv
import io
from dataclasses import dataclass
from pathlib import Path

from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import RUN_RECORD
from bsg_data.inputs.documents import decode
from bsg_models.errors import TrainingError


@dataclass(frozen=True, slots=True)
class EpochReport:
    """The result of one epoch.

    Attributes:
        epoch: counted from 1.
        epochs: of the whole training.
        train_loss: mean over the epoch's steps.
        val_loss: validation loss; None if this epoch was not validated.
        best_epoch: epoch with the lowest val_loss so far.
        seconds: that the epoch took.
    """

    epoch: int
    epochs: int
    train_loss: float
    val_loss: float | None
    best_epoch: int
    seconds: float


def encode_metrics(rows: list[EpochReport]) -> bytes:
    """Return reports as CSV."""
    text = io.StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(["epoch", "epochs", "train_loss", "val_loss", "best_epoch", "seconds"])
    for row in rows:
        val = "" if row.val_loss is None else repr(row.val_loss)
        numbers = [row.epoch, row.epochs, repr(row.train_loss), val, row.best_epoch]
        writer.writerow([*numbers, f"{row.seconds:.4f}"])
    return text.getvalue().encode()


def read_metrics(path: Path) -> list[EpochReport]:
    """Read the output of `encode_metrics`."""
    try:
        text = decode(read_bytes(path, RUN_RECORD, error=TrainingError))
        with io.StringIO(text, newline="") as file:
            return [
                EpochReport(
                    epoch=int(row["epoch"]),
                    epochs=int(row["epochs"]),
                    train_loss=float(row["train_loss"]),
                    val_loss=float(row["val_loss"]) if row["val_loss"] else None,
                    best_epoch=int(row["best_epoch"]),
                    seconds=float(row["seconds"]),
                )
                for row in csv.DictReader(file)
            ]
    except (KeyError, ValueError, TypeError, OverflowError, csv.Error) as error:
        raise TrainingError(f"{path}: not the metrics of a run ({error})") from error
