"""Checkpoints: safetensors with everything that is needed to load them again; no pickle.

The tensors are the model's state dict under `model.`, and for a training that can go on the
optimiser's under `adam.`. The header says the configuration, the class map and the dataset.
"""

from __future__ import annotations

import json
from dataclasses import dataclass
from pathlib import Path

import torch
from pydantic import Field, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from bsg_data.dataset.manifest import ClassMapEntry, Manifest, require_class_map
from bsg_data.dataset.schema import FORMAT_VERSION
from bsg_data.errors import MismatchError
from bsg_data.files import write_bytes
from bsg_data.recipes import Record
from bsg_models.errors import CheckpointError, ConfigError
from bsg_models.zoo.catalogue import make_model
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import BeliefModel

CHECKPOINT_VERSION = 1


class CheckpointHeader(Record):
    """What a checkpoint says of itself.

    Attributes:
        checkpoint_version: of this format.
        format_version: of the dataset format that it was trained on.
        config: of the run.
        class_map: whose histograms it reads and predicts.
        members: of an ensemble, by name: the recipes that they were trained by.
        vocabulary: the categories outside the classes that it reads, in the order of its columns.
        dataset_sha256: of the manifest of the dataset that it was trained on.
        calibrated: whether its calibration was fitted.
        epoch: epochs done; 0 for a model that was fitted by counting.
        val_loss: at that epoch; None without.
        best_epoch: with the lowest val_loss up to then.
        best_loss: that val_loss; None without.
    """

    checkpoint_version: int = CHECKPOINT_VERSION
    format_version: int = FORMAT_VERSION
    config: RunConfig
    class_map: ClassMapEntry
    members: dict[str, RunConfig] = Field(default_factory=dict)
    vocabulary: tuple[str, ...] = ()
    dataset_sha256: str
    calibrated: bool = False
    epoch: int = 0
    val_loss: float | None = None
    best_epoch: int = 0
    best_loss: float | None = None


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A loaded checkpoint.

    Attributes:
        header: what it says of itself.
        tensors: all of them, by name.
    """

    header: CheckpointHeader
    tensors: dict[str, torch.Tensor]

    def state_of(self, part: str) -> dict[str, torch.Tensor]:
        """Return the tensors under `part.`, without the prefix."""
        prefix = f"{part}."
        return {k.removeprefix(prefix): v for k, v in self.tensors.items() if k.startswith(prefix)}


def save_checkpoint(path: Path, header: CheckpointHeader, tensors: dict[str, torch.Tensor]) -> None:
    """Write a checkpoint beside its place and rename it there.

    Raises:
        DatasetError: if it cannot be written; an older one stays.
    """
    plain = {name: tensor.detach().contiguous() for name, tensor in tensors.items()}
    write_bytes(path, save(plain, metadata={"bsg": header.model_dump_json()}))


def load_checkpoint(path: Path) -> Checkpoint:
    """Read a checkpoint.

    Raises:
        CheckpointError: if it is missing, damaged, or of another version.
    """
    try:
        with safe_open(path, framework="pt") as file:
            words = (file.metadata() or {}).get("bsg")
            tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    except FileNotFoundError as error:
        raise CheckpointError(f"{path}: no checkpoint there; train one with `bsg-train`") from error
    except (SafetensorError, OSError) as error:
        raise CheckpointError(f"{path}: not a readable checkpoint ({error})") from error
    try:
        said = json.loads(words or "null")
        version = said["checkpoint_version"]
        if version != CHECKPOINT_VERSION:
            raise CheckpointError(
                f"{path}: checkpoint version {version}, this program reads {CHECKPOINT_VERSION}"
            )
        header = CheckpointHeader.model_validate(said)
    except (ValueError, KeyError, TypeError, ValidationError) as error:
        raise CheckpointError(
            f"{path}: its header is not a checkpoint's of this project"
        ) from error
    return Checkpoint(header, tensors)


def restore_model(path: Path, checkpoint: Checkpoint) -> BeliefModel:
    """Make the model of a checkpoint and give it its weights.

    Raises:
        CheckpointError: if a tensor is missing, unknown or of another shape.
    """
    header = checkpoint.header
    try:
        model = make_model(
            header.config,
            classes=len(header.class_map.classes),
            vocabulary=header.vocabulary,
            members=header.members,
        )
        model.resize_buffers(checkpoint.state_of("model"))
    except (ConfigError, CheckpointError) as error:
        raise CheckpointError(f"{path}: {error}") from error
    expected, found = model.state_dict(), checkpoint.state_of("model")
    for name in sorted(expected.keys() | found.keys()):
        ours = tuple(expected[name].shape) if name in expected else "no such tensor"
        theirs = tuple(found[name].shape) if name in found else "no such tensor"
        if ours != theirs:
            raise CheckpointError(
                f"{path}: {name}: its configuration needs {ours}, the file has {theirs}"
            )
        if name in found and not torch.isfinite(found[name]).all():
            raise CheckpointError(f"{path}: {name} has values that are not finite")
    model.load_state_dict(found)
    return model.eval()


def require_dataset(path: Path, header: CheckpointHeader, manifest: Manifest) -> None:
    """Refuse a dataset of another class map or format than the checkpoint's.

    Raises:
        MismatchError: naming both.
    """
    if header.format_version != manifest.format_version:
        raise MismatchError(
            f"checkpoint {path} is of dataset format {header.format_version}, "
            f"the dataset of {manifest.format_version}"
        )
    require_class_map(manifest, header.class_map, what=f"checkpoint {path}")
