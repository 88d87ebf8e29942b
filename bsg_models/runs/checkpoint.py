"""Read and write checkpoints: safetensors files that hold everything needed to restore a model.

The tensors are the model's state dict under `model.`, and the optimiser's under `adam.` if the
training can continue. The header holds the configuration, the class space, the dataset's hash and
the sha256 of the tensors; its own sha256 comes last. A flipped bit anywhere is refused. Nothing is
pickled.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import torch
from pydantic import Field, ValidationError
from safetensors import SafetensorError, safe_open
from safetensors.torch import save

from bsg_data.dataset.manifest import Manifest, require_class_space
from bsg_data.dataset.schema import FORMAT_VERSION
from bsg_data.files import AnyPath, write_bytes
from bsg_data.inputs.documents import parse_json
from bsg_data.recipes import Record, name_fault
from bsg_data.scene.class_map import OwnMap
from bsg_data.scene.class_space import ClassSpace
from bsg_models.errors import CheckpointError, ConfigError
from bsg_models.runs.checkpoint_file import require_safetensors
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.ensemble import make_model
from bsg_models.zoo.model import BeliefModel

CHECKPOINT_VERSION = 4
_SEAL = ',"sha256":"'  # begins the hash of the header, which covers all text before it
_AGAIN = "take another copy of it, or train again"


class CheckpointHeader(Record):
    """The header of a checkpoint."""

    checkpoint_version: int = CHECKPOINT_VERSION  # version of this format
    format_version: int = FORMAT_VERSION  # version of the dataset format that it was trained on
    config: RunConfig  # of the run
    class_space: ClassSpace  # classes of the histograms that it reads and predicts
    # one per source of its dataset: published maps by name, the user's own in full
    class_maps: tuple[str | OwnMap, ...] = ()
    # of an ensemble, name → recipe of the member's training
    members: dict[str, RunConfig] = Field(default_factory=dict)
    # categories outside the classes that it reads, in the order of its columns
    vocabulary: tuple[str, ...] = ()
    dataset_sha256: str  # of the manifest of the dataset that it was trained on
    calibrated: bool = False  # whether its calibration was fitted
    epoch: int = 0  # epochs done; 0 for a model that was fitted by counting
    val_loss: float | None = None  # validation loss at that epoch; None if there is none
    best_epoch: int = 0  # epoch with the lowest val_loss so far
    best_loss: float | None = None  # that val_loss; None if there is none
    # of names, types, shapes and bytes of the tensors; None until it is saved
    tensors_sha256: str | None = None


@dataclass(frozen=True, eq=False)
class Checkpoint:
    """A loaded checkpoint.

    Attributes:
        header: configuration, classes and hashes.
        tensors: all tensors, by name.
    """

    header: CheckpointHeader
    tensors: dict[str, torch.Tensor]

    def state_of(self, part: str) -> dict[str, torch.Tensor]:
        """Return the tensors under `part.`, without the prefix."""
        prefix = f"{part}."
        return {k.removeprefix(prefix): v for k, v in self.tensors.items() if k.startswith(prefix)}


def save_checkpoint(path: Path, header: CheckpointHeader, tensors: dict[str, torch.Tensor]) -> None:
    """Write a checkpoint to a temporary file and rename it."""
    plain = {name: tensor.detach().contiguous() for name, tensor in tensors.items()}
    sealed = {"checkpoint_version": CHECKPOINT_VERSION, "tensors_sha256": hash_tensors(plain)}
    text = header.model_copy(update=sealed).model_dump_json().removesuffix("}")
    write_bytes(path, save(plain, metadata={"bsg": f'{text}{_SEAL}{_hash_text(text)}"}}'}))


def hash_tensors(tensors: Mapping[str, torch.Tensor]) -> str:
    """Return the sha256 of tensors, sorted by name: name, type, shape and bytes of each."""
    digest = hashlib.sha256()
    for name, tensor in sorted(tensors.items()):
        kind = json.dumps([name, str(tensor.dtype), list(tensor.shape)])  # noqa: TID251
        digest.update(f"{kind}\n".encode())
        flat = tensor.detach().cpu().contiguous().reshape(-1)
        digest.update(flat.view(torch.uint8).numpy().tobytes())
    return digest.hexdigest()


def read_header(path: Path) -> CheckpointHeader:
    """Read the header of a checkpoint, without its tensors."""
    with _open(path) as file:
        return _parse_header(path, file)


def load_checkpoint(path: AnyPath) -> Checkpoint:
    """Read a checkpoint.

    Raises:
        CheckpointError: if it is missing, damaged, or has another version.
    """
    path = Path(path)
    with _open(path) as file:
        header = _parse_header(path, file)
        tensors = {name: file.get_tensor(name) for name in file.keys()}  # noqa: SIM118
    if header.tensors_sha256 != hash_tensors(tensors):
        raise CheckpointError(
            f"{path}: is damaged: the sha256 of its tensors is not the one in its header; {_AGAIN}"
        )
    return Checkpoint(header, tensors)


@contextmanager
def _open(path: Path) -> Iterator[Any]:
    require_safetensors(path)
    try:
        with safe_open(path, framework="pt") as file:
            _require_plain_end(path)
            yield file
    except (SafetensorError, OSError, RuntimeError) as error:  # torch raises the last
        raise CheckpointError(f"{path}: not a readable checkpoint ({error})") from error


def _require_plain_end(path: Path) -> None:
    """Refuse characters after the JSON other than the spaces of safetensors.

    They have no meaning, and no hash covers them.
    """
    with path.open("rb") as file:
        text = file.read(int.from_bytes(file.read(8), "little"))
    if not text.rstrip(b" ").endswith(b"}"):
        raise CheckpointError(f"{path}: is damaged: its header has a wrong end; {_AGAIN}")


def _parse_header(path: Path, file: Any) -> CheckpointHeader:
    text = str((file.metadata() or {}).get("bsg", "null"))
    try:
        fields = parse_json(text)
        version = fields["checkpoint_version"]
        if version != CHECKPOINT_VERSION:
            raise CheckpointError(
                f"{path}: checkpoint version {version!r:.20}, this program reads "
                f"{CHECKPOINT_VERSION}; train again"
            )
        covered, _, seal = text.rpartition(_SEAL)
        if seal != f'{_hash_text(covered)}"}}':
            raise CheckpointError(
                f"{path}: is damaged: its header does not match its sha256; {_AGAIN}"
            )
        del fields["sha256"]
        header = CheckpointHeader.model_validate(fields)
    except ValidationError as error:  # also raised if a model's package is not installed
        raise CheckpointError(
            f"{path}: its header is not a checkpoint's of this project: {name_fault(error)}"
        ) from error
    except (ValueError, KeyError, TypeError, RecursionError) as error:
        raise CheckpointError(
            f"{path}: its header is not a checkpoint's of this project"
        ) from error
    return header


def _hash_text(text: str) -> str:
    return hashlib.sha256(text.encode("utf-8", "surrogatepass")).hexdigest()


def restore_model(path: AnyPath, checkpoint: Checkpoint) -> BeliefModel:
    """Make the model of a checkpoint and load its weights.

    Raises:
        CheckpointError: if a tensor is missing, unknown or has another shape.
    """
    path = Path(path)
    header, stored = checkpoint.header, checkpoint.state_of("model")
    try:
        model = make_model(
            header.config,
            classes=len(header.class_space.classes),
            vocabulary=header.vocabulary,
            members=header.members,
        )
        model.resize_buffers(stored)
    except (ConfigError, CheckpointError) as error:
        raise CheckpointError(f"{path}: {error}") from error
    expected = model.state_dict()
    for name in sorted(expected.keys() | stored.keys()):
        ours = tuple(expected[name].shape) if name in expected else "no such tensor"
        theirs = tuple(stored[name].shape) if name in stored else "no such tensor"
        if ours != theirs:
            raise CheckpointError(
                f"{path}: {name}: its configuration needs {ours}, the file has {theirs}"
            )
        if name in stored and not torch.isfinite(stored[name]).all():
            raise CheckpointError(f"{path}: {name} has values that are not finite")
    model.load_state_dict(stored)
    model.origin = str(path)
    return model.eval()


def require_dataset(path: Path, header: CheckpointHeader, manifest: Manifest) -> None:
    """Refuse a dataset whose class space differs from the checkpoint's."""
    require_class_space(manifest, header.class_space, what=f"checkpoint {path}")
