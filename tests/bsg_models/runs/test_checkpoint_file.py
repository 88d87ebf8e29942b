"""What a checkpoint's first bytes tell: files that are cut, too large, or something else."""

from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.inputs.bounds import CHECKPOINT, CHECKPOINT_HEADER
from bsg_models.errors import CheckpointError
from bsg_models.runs.checkpoint_file import require_safetensors


def write(path: Path, *, header: int, size: int) -> Path:
    """Write a file that says a length of its header; it takes no room on the disk."""
    with path.open("wb") as file:
        file.write(header.to_bytes(8, "little"))
        file.truncate(size)
    return path


@pytest.mark.parametrize(
    ("header", "size", "message"),
    [
        (10, 17, "cut off, or not safetensors"),
        (0, 4, "cut off, or not safetensors"),
        (2**63, 100, "cut off, or not safetensors"),
        (10, CHECKPOINT.bytes + 1, r"4,294,967,297 bytes; expected at most 4,294,967,296"),
        (
            CHECKPOINT_HEADER.bytes + 1,
            CHECKPOINT.bytes,
            r"16,777,217 bytes in its header; expected at most 16,777,216",
        ),
    ],
)
def test_what_cannot_be_a_checkpoint_is_refused(
    tmp_path: Path, header: int, size: int, message: str
) -> None:
    path = write(tmp_path / "model.safetensors", header=header, size=size)
    with pytest.raises(CheckpointError, match=f"model.safetensors: not a readable .*{message}"):
        require_safetensors(path)


def test_a_file_as_long_as_it_says_may_be_one(tmp_path: Path) -> None:
    require_safetensors(write(tmp_path / "model.safetensors", header=10, size=18))


def test_no_file_is_no_checkpoint(tmp_path: Path) -> None:
    with pytest.raises(CheckpointError, match="no checkpoint there; train one"):
        require_safetensors(tmp_path / "model.safetensors")
    with pytest.raises(CheckpointError, match="not a readable checkpoint"):
        require_safetensors(tmp_path)
