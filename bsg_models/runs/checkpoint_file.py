"""Read the header of a checkpoint, before anything slow is imported."""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

from bsg_data.errors import ask_to_upgrade
from bsg_data.inputs.documents import parse_json
from bsg_models.errors import CheckpointError

BEST = "best.safetensors"  # of a run
CHECKPOINT_VERSION = 1
_LENGTH = 8  # bytes that hold the length of the header


def read_fields(path: Path) -> dict[str, Any]:
    """Return the fields of a checkpoint's header, without its tensors.

    Raises:
        CheckpointError: if it is missing, no checkpoint, too large, damaged, or of another version.
    """
    with open_checkpoint(path) as (_, fields):
        return fields


@contextmanager
def open_checkpoint(path: Path) -> Iterator[tuple[BinaryIO, dict[str, Any]]]:
    """Open a checkpoint, and yield it with the fields of its header."""
    try:
        with path.open("rb") as file:
            yield file, _parse(_read_header(file, path), path)
    except FileNotFoundError as error:
        raise CheckpointError(f"{path}: no checkpoint there; train one with `bsg-train`") from error
    except OSError as error:
        raise CheckpointError(f"{path}: not a readable checkpoint ({error})") from error


def _read_header(file: BinaryIO, path: Path) -> bytes:
    """Return the JSON of a safetensors file, which begins with its length."""
    size, length = os.fstat(file.fileno()).st_size, int.from_bytes(file.read(_LENGTH), "little")
    if length > size - _LENGTH:
        raise CheckpointError(
            f"{path}: not a readable checkpoint (it is cut off or not safetensors)"
        )
    return file.read(length)


def _parse(header: bytes, path: Path) -> dict[str, Any]:
    try:
        fields = dict(parse_json(parse_json(header)["__metadata__"]["bsg"]))
        version = fields["checkpoint_version"]
    except (ValueError, KeyError, TypeError) as error:
        raise CheckpointError(
            f"{path}: its header is not a checkpoint's of this project"
        ) from error
    if version != CHECKPOINT_VERSION:
        raise CheckpointError(
            f"{path}: checkpoint version {version!r:.20}, this program reads "
            f"{CHECKPOINT_VERSION}; "
            + ask_to_upgrade(version, CHECKPOINT_VERSION, otherwise="train again")
        )
    return fields
