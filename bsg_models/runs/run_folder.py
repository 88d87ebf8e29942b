"""The folder of a run: what a finished training leaves, under a seal."""

from __future__ import annotations

import csv
import io
from collections import Counter
from collections.abc import Collection, Iterable
from pathlib import Path
from typing import TYPE_CHECKING

from pydantic import Field, ValidationError

from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.documents import parse_json
from bsg_data.records import Record, name_fault
from bsg_data.seal import read_seal
from bsg_models.errors import TrainingError
from bsg_models.runs.checkpoint_file import BEST

if TYPE_CHECKING:  # a card is read without Arrow
    from bsg_data.dataset.dataset import Dataset

CONFIG, RECORD = "config.toml", "training.json"
METRICS, CURVE = "metrics.csv", "curve.png"  # only of networks
UNKNOWN = "unknown"


class TrainedOn(Record):
    """One source of a model's training data."""

    source: str  # its kind, e.g. `hm3d`.
    buildings: int = Field(ge=0)  # number that it learned from
    licence: str = UNKNOWN  # SPDX, or `unknown`
    licence_url: str = ""  # link to the licence; empty if unknown
    sentence: str = ""  # what a user must know of the terms
    citation: str = ""  # of the source


class EpochReport(Record):
    """The result of one epoch."""

    epoch: int  # counted from 1
    epochs: int  # of the whole training
    train_loss: float  # mean over the epoch's steps
    val_loss: float | None = None  # validation loss; None if this epoch was not validated
    best_epoch: int  # epoch with the lowest val_loss so far
    seconds: float  # that the epoch took


def encode_metrics(reports: Iterable[EpochReport], *, header: bool = True) -> str:
    """Return reports as the lines of `metrics.csv`."""
    text, names = io.StringIO(), [name for name in EpochReport.model_fields if name != "epochs"]
    writer = csv.DictWriter(text, names, extrasaction="ignore", lineterminator="\n")
    if header:
        writer.writeheader()
    writer.writerows(
        {**report.model_dump(), "seconds": f"{report.seconds:.4f}"} for report in reports
    )
    return text.getvalue()


class TrainingRecord(Record):
    """How a training went, besides its configuration and its epochs."""

    time: str  # of its end, UTC
    seconds: float  # that it took; of one that went on after a kill, since then
    versions: dict[str, str]  # package → version; includes `python`
    notes: tuple[str, ...] = ()  # what it left out, such as rooms above a limit
    trained_on: tuple[TrainedOn, ...] = ()  # the sources, in the order of the dataset


def list_trained_on(data: Dataset, scenes: Collection[str]) -> tuple[TrainedOn, ...]:
    """Return the sources of some buildings of a dataset, their numbers and their terms."""
    table = data.read_table("scenes", columns=["scene_id", "source"])
    sources = dict(zip(*(table[name].to_pylist() for name in ("scene_id", "source")), strict=True))
    buildings = Counter(sources[scene] for scene in scenes)
    terms = {entry.kind: entry.terms for entry in data.manifest.sources}
    names = ("licence", "licence_url", "sentence", "citation")
    return tuple(
        TrainedOn(
            source=kind,
            buildings=buildings[kind],
            **({name: getattr(found, name) for name in names} if found else {}),
        )
        for kind, found in terms.items()
        if buildings[kind]
    )


def checkpoint_of(run: Path) -> Path:
    """Return the best checkpoint of a run; a file is returned as it is."""
    return run / BEST if run.is_dir() else run


def list_outdated(run: Path) -> tuple[Path, ...]:
    """Return the folders of an evaluation and a search in a run that measure other weights.

    They say what they measured; a later training may have replaced the run.
    """
    weights = (read_seal(run) or {}).get(BEST)
    reports = [run / name / f"{name}.json" for name in ("evaluation", "search")]
    measured = {
        path.parent: parse_json(path.read_bytes()).get("checkpoints_sha256", [weights])
        for path in reports
        if weights and path.is_file()
    }
    return tuple(folder for folder, hashes in measured.items() if weights not in hashes)


def read_record(run: Path) -> TrainingRecord | None:
    """Return how the training of a run went; None if the run does not say.

    Raises:
        TrainingError: if its record is damaged.
    """
    path = run / RECORD
    if not path.is_file():
        return None
    try:
        return TrainingRecord.model_validate_json(read_bytes(path, error=TrainingError))
    except ValidationError as error:
        raise TrainingError(f"{path}: is no record of a training ({name_fault(error)})") from error
