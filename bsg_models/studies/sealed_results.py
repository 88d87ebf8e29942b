"""Whether a folder of results is what its seal says, and its files are what they should be."""

from __future__ import annotations

from collections import deque
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.seals import SEAL, require_seal
from bsg_models.belief.table_rows import NODES
from bsg_models.belief.tables import read_tables
from bsg_models.runs.checkpoint import load_checkpoint, restore_model

_WEIGHTS = ".safetensors"


def check_results(path: Path) -> tuple[str, ...]:
    """Check a run, a checkpoint, belief tables, or the results of a search or an evaluation.

    Args:
        path: of the folder, or of a checkpoint.

    Returns:
        the names of the files that are as they were written.

    Raises:
        DatasetError: naming a file that was changed, or if the folder has no seal.
        CheckpointError: if a checkpoint is damaged.
        BeliefFileError: if belief tables are.
    """
    if path.is_file():
        restore_model(path, load_checkpoint(path))
        return (path.name,)
    if not path.is_dir():
        raise DatasetError(f"{path}: no such folder or file")
    sums = require_seal(path)
    if not sums:
        raise DatasetError(
            f"{path}: has no {SEAL}, or an empty one: its command was stopped, or is of an earlier "
            "version, or it is no folder of results; nothing can be told of it"
        )
    for folder in {(path / name).parent for name in sums} - {path}:
        require_seal(folder)  # of an ensemble's member
    for name in sums:
        if name.endswith(_WEIGHTS):
            restore_model(path / name, load_checkpoint(path / name))
    if NODES in sums:
        deque(read_tables(path), maxlen=0)
    return tuple(sums)
