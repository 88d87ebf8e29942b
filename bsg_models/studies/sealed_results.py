"""Check a folder of results against its seal, and load its checkpoints and tables."""

from __future__ import annotations

from collections import deque
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.seals import SEAL, require_seal
from bsg_models.runs.checkpoint_file import require_safetensors

_WEIGHTS, _NODES = ".safetensors", "nodes.parquet"


def check_results(path: Path) -> tuple[str, ...]:
    """Check a run, a checkpoint, belief tables, or the results of a search or an evaluation.

    Args:
        path: of the folder, or of a checkpoint.

    Returns:
        Names of the files that are as they were written.

    Raises:
        DatasetError: naming a file that was changed, or if the folder has no seal.
        CheckpointError: if a checkpoint is damaged.
        BeliefFileError: if belief tables are damaged.
    """
    if path.is_file():
        _load(path)
        return (path.name,)
    if not path.is_dir():
        raise DatasetError(f"{path}: no such folder or file")
    sums = require_seal(path)
    if not sums and (path / "dataset.json").is_file():
        raise DatasetError(f"{path}: is a dataset; `bsg-data check {path}` checks it")
    if not sums:
        raise DatasetError(
            f"{path}: has no {SEAL}, or an empty one, so it cannot be checked: its command was "
            "stopped, an earlier version wrote it, or it is not a folder of results"
        )
    for folder in {(path / name).parent for name in sums} - {path}:
        require_seal(folder)  # the run of an ensemble's member
    for name in sums:
        if name.endswith(_WEIGHTS):
            _load(path / name)
    if _NODES in sums:
        from bsg_models.belief.tables import read_tables

        deque(read_tables(path), maxlen=0)
    return tuple(sums)


def _load(path: Path) -> None:
    """Make the model of a checkpoint, to check that it can be made.

    The import of the models takes seconds, so a file that is no checkpoint is refused before.
    """
    require_safetensors(path)
    from bsg_models.runs.checkpoint import load_checkpoint, restore_model

    restore_model(path, load_checkpoint(path))
