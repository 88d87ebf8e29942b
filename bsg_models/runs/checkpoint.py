"""Read and write checkpoints: safetensors files that hold everything needed to restore a model.

The tensors are the model's state dict under `model.`; a training that was stopped has more
(`bsg_models.training.epochs`). The header holds the configuration, the class space and the hash of
the dataset. Nothing is pickled. Where `SHA256SUMS` beside a checkpoint lists it, as in a run, a
file with another hash is refused.
"""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt
from pydantic import Field, ValidationError
from safetensors import SafetensorError
from safetensors.numpy import load, save

from bsg_data.files import AnyPath, write_bytes
from bsg_data.records import Record, name_fault
from bsg_data.scene.class_map import OwnMap
from bsg_data.scene.class_space import ClassSpace
from bsg_data.seal import SEAL, read_seal
from bsg_data.words.shown import show_value
from bsg_models.errors import CheckpointError, ConfigError
from bsg_models.inputs.folds import untaught_of
from bsg_models.runs.checkpoint_file import (
    BEST,
    CHECKPOINT_VERSION,
    open_checkpoint,
    read_fields,
)
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import BeliefModel, State, make_model

if TYPE_CHECKING:
    from bsg_data.dataset.dataset import Dataset


class CheckpointHeader(Record):
    """The header of a checkpoint."""

    checkpoint_version: int = CHECKPOINT_VERSION  # version of this format
    format_version: int  # version of the dataset format that it was trained on
    config: RunConfig  # of the run
    class_space: ClassSpace  # classes of the histograms that it reads and predicts
    # one per source of its dataset: published maps by name, the user's own in full
    class_maps: tuple[str | OwnMap, ...] = ()
    # of an ensemble, name → recipe of the member's training
    members: dict[str, RunConfig] = Field(default_factory=dict)
    package: str | None = None  # that brings the model; None for a model of this project
    # categories outside the classes that it reads, in the order of its columns
    vocabulary: tuple[str, ...] = ()
    untaught: tuple[str, ...] = ()  # classes of which no train building had an object
    dataset_sha256: str  # of the manifest of the dataset that it was trained on
    calibrated: bool = False  # whether its calibration was fitted
    epoch: int = 0  # epochs done; 0 for a model that was fitted by counting
    val_loss: float | None = None  # validation loss at that epoch; None if there is none
    best_epoch: int = 0  # epoch with the lowest val_loss so far
    best_loss: float | None = None  # that val_loss; None if there is none

    def is_of(self, config: RunConfig, data: Dataset) -> bool:
        """Return whether the checkpoint is of this configuration and dataset."""
        return (self.config, self.dataset_sha256) == (config, data.sha256)


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A loaded checkpoint."""

    header: CheckpointHeader  # configuration, classes and data
    tensors: State  # by name

    def state_of(self, part: str) -> State:
        """Return the tensors under `part.`, without the prefix."""
        prefix = f"{part}."
        return {k.removeprefix(prefix): v for k, v in self.tensors.items() if k.startswith(prefix)}


def make_header(
    config: RunConfig, data: Dataset, *, vocabulary: tuple[str, ...], **fields: Any
) -> CheckpointHeader:
    """Return the header for a checkpoint of a run; `fields` are its other fields."""
    return CheckpointHeader(
        format_version=data.manifest.format_version,
        config=config,
        class_space=data.manifest.class_space,
        class_maps=tuple(entry.read(data.path) for entry in data.manifest.class_maps),
        package=ZOO.package_of(config.model.family),
        vocabulary=vocabulary,
        untaught=untaught_of(data, fold=config.data.fold),
        dataset_sha256=data.sha256,
        **fields,
    )


def name_tensors(part: str, state: Mapping[str, npt.NDArray[Any]]) -> State:
    """Return a state dict under `part.`."""
    return {f"{part}.{name}": tensor for name, tensor in state.items()}


def save_checkpoint(path: Path, header: CheckpointHeader, tensors: State) -> None:
    """Write a checkpoint, whole or not at all."""
    plain = {name: np.asarray(tensor, order="C") for name, tensor in tensors.items()}
    write_bytes(path, save(plain, metadata={"bsg": header.model_dump_json()}))


def save_model(
    model: BeliefModel,
    config: RunConfig,
    data: Dataset,
    path: Path,
    **fields: Any,
) -> None:
    """Save a model that was trained on a dataset; `fields` are other fields of the header."""
    header = make_header(config, data, vocabulary=model.vocabulary, **fields)
    save_checkpoint(path, header, name_tensors("model", model.state()))


def read_header(path: Path) -> CheckpointHeader:
    """Read the header of a checkpoint, without its tensors."""
    return _validate(read_fields(path), path)


def load_checkpoint(path: AnyPath) -> Checkpoint:
    """Read a checkpoint.

    Raises:
        CheckpointError: if it is missing, damaged, or has another version.
    """
    path = Path(path)
    with open_checkpoint(path) as (file, fields):
        file.seek(0)
        data = file.read()
    listed = (read_seal(path.parent) or {}).get(path.name)
    if listed not in (None, hashlib.sha256(data).hexdigest()):
        raise CheckpointError(
            f"{path}: is damaged: its sha256 is not the one in {SEAL}; take another copy of it, or "
            "train or install again"
        )
    try:
        tensors = load(data)
    except (SafetensorError, KeyError, ValueError) as error:  # NumPy raises the last two
        raise CheckpointError(f"{path}: not a readable checkpoint ({error})") from error
    return Checkpoint(_validate(fields, path), tensors)


def _validate(fields: dict[str, Any], path: Path) -> CheckpointHeader:
    try:
        return CheckpointHeader.model_validate(fields)
    except ValidationError as error:  # also raised if a model's package is not installed
        package = fields.get("package")
        hint = f"; it is from the package {show_value(package)}" if package else ""
        raise CheckpointError(
            f"{path}: its header is not a checkpoint's of this project: {name_fault(error)}{hint}"
        ) from error


def restore_model(path: AnyPath, checkpoint: Checkpoint) -> BeliefModel:
    """Make the model of a checkpoint and load its weights.

    Raises:
        CheckpointError: if a tensor is missing, unknown or has another shape.
    """
    header, stored = checkpoint.header, checkpoint.state_of("model")
    try:
        model = make_model(
            header.config,
            classes=len(header.class_space.classes),
            vocabulary=header.vocabulary,
            members=header.members,
        )
        model.load_state(stored)
    except (ConfigError, CheckpointError) as error:
        raise CheckpointError(f"{path}: {error}") from error
    model.origin = str(path)
    if header.untaught:
        model.untaught = np.isin(header.class_space.classes, header.untaught)
    return model


def is_finished(run: Path, config: RunConfig, data: Dataset) -> bool:
    """Return whether a run is complete and of this configuration and dataset."""
    try:
        return (run / SEAL).is_file() and read_header(run / BEST).is_of(config, data)
    except CheckpointError:
        return False
