"""Check the first bytes of a checkpoint, and read its header, before anything slow is imported."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from bsg_data.inputs.bounds import CHECKPOINT, CHECKPOINT_HEADER
from bsg_data.inputs.documents import parse_json
from bsg_models.errors import CheckpointError

_LENGTH = 8  # bytes that hold the length of the header


def require_safetensors(path: Path) -> None:
    """Refuse a file that is not safetensors, or is larger than any model of this project."""
    try:
        with path.open("rb") as file:
            size = os.fstat(file.fileno()).st_size
            header = int.from_bytes(file.read(_LENGTH), "little")
    except FileNotFoundError as error:
        raise CheckpointError(f"{path}: no checkpoint there; train one with `bsg-train`") from error
    except OSError as error:
        raise CheckpointError(f"{path}: not a readable checkpoint ({error})") from error
    if not path.is_file():
        raise CheckpointError(f"{path}: not a readable checkpoint (it is not a regular file)")
    if size > CHECKPOINT.bytes:
        raise _refuse(path, size, "", CHECKPOINT.bytes)
    if header > size - _LENGTH:
        raise CheckpointError(
            f"{path}: not a readable checkpoint (it is cut off, or not safetensors: such a file "
            "begins with the length of its header)"
        )
    if header > CHECKPOINT_HEADER.bytes:
        raise _refuse(path, header, " in its header", CHECKPOINT_HEADER.bytes)


def read_plain_header(path: Path) -> dict[str, Any]:
    """Return the header of a checkpoint as it stands; only for a file whose hash is known."""
    require_safetensors(path)
    with path.open("rb") as file:
        text = file.read(int.from_bytes(file.read(_LENGTH), "little"))
    try:
        return dict(parse_json(parse_json(text)["__metadata__"]["bsg"]))
    except (ValueError, KeyError, TypeError) as error:
        raise CheckpointError(
            f"{path}: its header is not a checkpoint's of this project"
        ) from error


def _refuse(path: Path, found: int, where: str, most: int) -> CheckpointError:
    return CheckpointError(
        f"{path}: not a readable checkpoint ({found:,} bytes{where}; expected at most {most:,})"
    )
