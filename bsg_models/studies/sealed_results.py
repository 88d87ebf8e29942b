"""Check a folder of results against its seal, and load its checkpoints and tables.

An evaluation or a search of a run lies in the run's folder and lists the sha256 of the checkpoints
that it measured. A later training may replace the run: then its checkpoint is none of these.
"""

from __future__ import annotations

from pathlib import Path

from bsg_data.errors import BSGError, DatasetError
from bsg_data.files import AnyPath, resolve_links
from bsg_data.inputs.bounded_file import hash_file, read_bytes
from bsg_data.inputs.documents import parse_json
from bsg_data.seal import SEAL, require_seal
from bsg_models.runs.checkpoint_file import read_fields

_WEIGHTS = ".safetensors"
_BEST = "best.safetensors"
_OF_A_RUN = {"evaluation": "evaluation.json", "search": "search.json"}  # folder in a run → report


def check_results(path: AnyPath) -> tuple[str, ...]:
    """Check a run, a checkpoint, or a folder of results, such as those of an evaluation.

    Args:
        path: of the folder, or of a checkpoint.

    Returns:
        Names of the files that are as they were written.

    Raises:
        DatasetError: naming a file that was changed, or if the folder has no seal or is the
            evaluation or the search of a run that has other weights by now.
        CheckpointError: if a checkpoint is damaged.
    """
    path = Path(path)
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
            "stopped, or it is not a folder of results"
        )
    for name in sums:
        if name.endswith(_WEIGHTS):
            _load(path / name)
    here = resolve_links(path)
    if here.name in _OF_A_RUN and _measures_other_weights(here):
        raise DatasetError(
            f"{path}: measures other weights than those of its run: the sha256 of "
            f"{path.parent / _BEST} is not in {_OF_A_RUN[here.name]}; measure the run again with "
            "--force"
        )
    return tuple(sums)


def list_of_other_weights(run: Path) -> tuple[Path, ...]:
    """Return the folders of an evaluation and a search in a run that measure other weights."""
    return tuple(run / name for name in _OF_A_RUN if _measures_other_weights(run / name))


def _measures_other_weights(results: Path) -> bool:
    """Say whether the evaluation or the search of a run is not of the run's present checkpoint."""
    report, best = results / _OF_A_RUN[results.name], results.parent / _BEST
    if not (report.is_file() and best.is_file()):
        return False
    try:
        measured = parse_json(read_bytes(report, error=DatasetError))["checkpoints_sha256"]
        return hash_file(best) not in measured
    except (BSGError, OSError, LookupError, TypeError, ValueError):
        return False  # the seal speaks of damage


def _load(path: Path) -> None:
    """Make the model of a checkpoint, to check that it can be made.

    The import of the models takes seconds, so a file that is no checkpoint is refused before.
    """
    read_fields(path)
    from bsg_models.runs.checkpoint import load_checkpoint, restore_model

    restore_model(path, load_checkpoint(path))
