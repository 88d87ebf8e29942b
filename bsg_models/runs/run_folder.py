"""List, seal and remove the files of a run folder, and tell whether it is finished."""

from __future__ import annotations

import os
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

import torch

from bsg_data.dataset.dataset import Dataset
from bsg_data.errors import DatasetError
from bsg_data.files import hold
from bsg_data.inputs.bounded_file import hash_file, open_stream
from bsg_data.inputs.bounds import RUN_RECORD
from bsg_data.results import (
    SEAL,
    UNFINISHED,
    list_files,
    put_in_place,
    read_seal,
    refuse_datasets,
    refuse_other_results,
    remove_unfinished,
    require_seal,
    write_seal,
)
from bsg_models.errors import CheckpointError, TrainingError
from bsg_models.runs.checkpoint import CheckpointHeader, read_header, save_checkpoint
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import BeliefModel

BEST, LAST = "best.safetensors", "last.safetensors"
METRICS, CURVE = "metrics.csv", "curve.png"
CONFIG, LOG = "config.toml", "log.jsonl"
FILES = (BEST, LAST, METRICS, CURVE, CONFIG, LOG)
_BEGUN = b'{"event":"begun",'  # first bytes of the log of every run
_SECONDS_TO_WAIT = 10.0  # for another command that adds a file to the run
MEMBERS = "members"  # folder with the runs of an ensemble's members


def checkpoint_of(run: Path) -> Path:
    """Return the best checkpoint of a run; a file is returned as it is."""
    return run / BEST if run.is_dir() else run


def _seal_run(run: Path) -> None:
    """Write the seal of a finished run: the hashes of all its files.

    An ensemble's seal also covers its members' files, except their curves: these may be plotted
    later, and a member has its own seal.
    """
    members = read_header(run / BEST).members if (run / BEST).is_file() else ()
    trained = [file for file in FILES if file != CURVE]
    names = [*FILES, *(f"{MEMBERS}/{name}/{file}" for name in members for file in trained)]
    write_seal(run, [name for name in sorted(names) if (run / name).is_file()])


@contextmanager
def reseal(run: Path) -> Iterator[None]:
    """Hold the lock of a run while a file is added, and seal the run again if it was sealed."""
    with hold(run, wait=_SECONDS_TO_WAIT):
        sealed = require_seal(run) is not None
        with unsealed(run):
            yield
        if sealed:
            _seal_run(run)


@contextmanager
def open_run(run: Path, *, resume: bool = False, force: bool = True) -> Iterator[Path]:
    """Hold the lock of a run, yield its folder to train into, and seal it at the end.

    Two trainings never write into one run: the second finds the lock, or the finished run.

    Args:
        run: its folder, which is created.
        resume: whether to continue what is there; it must match its seal.
        force: whether to replace a run; a finished one stays until the new one is whole, which
            grows in its `UNFINISHED` folder.
    """
    try:
        run.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        message = f"{run}: cannot be made ({error.strerror})"
        raise TrainingError(message, code="not-written", where=run) from error
    with hold(run):
        refuse_overwriting(run, resume=resume, force=force)
        if resume:
            place = active_folder(run)
            require_seal(place)
        else:
            remove_unfinished(run)
            place = run if read_seal(run) is None else run / UNFINISHED
            clear_run(place)
        if place == run:
            remove_unfinished(run)
        place.mkdir(exist_ok=True)
        _remove_files(place, _list_half_written(place))
        with unsealed(place):
            yield place
        _seal_run(place)
        if place != run:
            _replace(run)


def finish_replacing(run: Path) -> None:
    """Go on with putting a new run in the place of an old one, if that was killed."""
    if read_seal(run / UNFINISHED) is not None and read_seal(run) is None:
        with hold(run):
            _replace(run)


def _replace(run: Path) -> None:
    """Put the new run, which is whole and sealed, in the place of the old one."""
    new = {*list_files(run / UNFINISHED)}
    sealed = {*(read_seal(run / UNFINISHED) or ())}
    leaving = {*_list_run(run)} - new if sealed <= new else ()  # one that moved: all has left
    put_in_place(run, leaving=leaving)
    remove_unfinished(run)


def active_folder(run: Path) -> Path:
    """Return the folder that a training of a run goes on in: inside it, if it replaces the run."""
    return run / UNFINISHED if _is_run(run / UNFINISHED) else run


def refuse_overwriting(run: Path, *, resume: bool, force: bool) -> None:
    """Refuse a folder that holds a run, unless the run is continued or replaced."""
    refuse_foreign_files(run)
    if _has_checkpoint(run) and not (resume or force):
        message = f"{run}: holds a run already; --resume continues it, --force replaces it"
        raise TrainingError(message, code="run-exists", where=run)


def refuse_foreign_files(run: Path) -> None:
    """Refuse a folder where other files have the names of a run's files."""
    refuse_datasets(run)
    if run.exists() and not run.is_dir():
        message = f"{run}: is a file; expected a folder for the run"
        raise TrainingError(message, code="path-taken", where=run)
    refuse_other_results(run, BEST)
    if _is_run(run):
        return
    for name in (*FILES, SEAL):
        if (run / name).exists() or (run / name).is_symlink():
            raise TrainingError(
                f"{run / name}: was not written by bsg-train, which would replace it; move it "
                "away, or choose another folder",
                code="foreign-file",
                where=run / name,
            )


@contextmanager
def unsealed(run: Path) -> Iterator[None]:
    """Remove the seal while files change; restore it if that fails before any has changed."""
    before = read_seal(run)
    (run / SEAL).unlink(missing_ok=True)
    try:
        yield
    except BaseException:
        with suppress(DatasetError, OSError):
            if before and all(hash_file(run / name) == before[name] for name in before):
                write_seal(run, before)
        raise


def _is_run(folder: Path) -> bool:
    """Return whether a folder was begun by a training, as the first line of its log shows."""
    try:
        with open_stream(folder / LOG, RUN_RECORD, error=TrainingError) as log:
            return log.read(len(_BEGUN)) == _BEGUN
    except TrainingError:
        return False


def refuse_run(folder: Path) -> None:
    """Refuse to put other results into a run; a stopped run has no seal to recognise it by."""
    if _is_run(folder):
        raise DatasetError(f"{folder}: is a run of bsg-train; choose another folder")


def _has_checkpoint(run: Path) -> bool:
    """Return whether a run, or a member of it, has saved anything that a training can continue."""
    return any(Path(name).name in (BEST, LAST, METRICS) for name in _list_run(run))


def _list_run(run: Path) -> list[str]:
    """Return the existing files of a run and of its members, as paths below its folder.

    The log of each comes last. A folder with a log is a run, so a stopped removal leaves a run.
    """
    found = [name for name in (SEAL, *FILES) if _is_file(run / name)]
    members = run / MEMBERS
    if members.is_symlink() or not members.is_dir():
        return found
    return [
        *(
            f"{MEMBERS}/{member.name}/{name}"
            for member in sorted(members.iterdir())
            if member.is_dir() and not member.is_symlink() and _is_run(member)
            for name in _list_run(member)
        ),
        *found,
    ]


def _is_file(path: Path) -> bool:
    return path.is_symlink() or (os.path.lexists(path) and not path.is_dir())


def _list_half_written(run: Path) -> list[str]:
    """Return the unfinished files that a killed training left, as paths below a run."""
    return [path.name for name in (SEAL, *FILES) for path in run.glob(f".{name}.partial")]


def clear_run(run: Path) -> None:
    """Remove the files of a run and its members, and folders in it that become empty."""
    _remove_files(run, _list_run(run))


def _remove_files(folder: Path, names: Sequence[str]) -> None:
    """Remove files of a folder, and folders in it that become empty."""
    for name in names:
        (folder / name).unlink(missing_ok=True)
    for above in sorted({path for name in names for path in Path(name).parents}, reverse=True):
        if above.parts and (folder / above).is_dir() and not any((folder / above).iterdir()):
            (folder / above).rmdir()


def make_header(
    config: RunConfig,
    data: Dataset,
    *,
    vocabulary: tuple[str, ...],
    epoch: int = 0,
    val_loss: float | None = None,
    best_epoch: int = 0,
    best_loss: float | None = None,
) -> CheckpointHeader:
    """Return the header for a checkpoint of a run."""
    return CheckpointHeader(
        config=config,
        class_space=data.manifest.class_space,
        class_maps=tuple(entry.read(data.path) for entry in data.manifest.class_maps),
        vocabulary=vocabulary,
        dataset_sha256=data.sha256,
        epoch=epoch,
        val_loss=val_loss,
        best_epoch=best_epoch,
        best_loss=best_loss,
    )


def name_tensors(prefix: str, state: dict[str, torch.Tensor]) -> dict[str, torch.Tensor]:
    """Return a state dict with the prefix `prefix.` before its names."""
    return {f"{prefix}.{name}": tensor for name, tensor in state.items()}


def save_fitted(
    model: BeliefModel,
    config: RunConfig,
    data: Dataset,
    run: Path,
    *,
    calibrated: bool,
    members: Mapping[str, RunConfig] | None = None,
) -> None:
    """Save a model that was fitted by counting, or made of members."""
    header = make_header(config, data, vocabulary=model.vocabulary)
    update = {"calibrated": calibrated, "members": dict(members or {})}
    header = header.model_copy(update=update)
    save_checkpoint(run / BEST, header, name_tensors("model", model.state_dict()))


def is_finished(run: Path, config: RunConfig, data: Dataset) -> bool:
    """Return whether a run is complete and of this configuration and dataset."""
    if read_seal(run) is None:
        return False
    try:
        header = read_header(run / BEST)
        last = read_header(run / LAST).epoch if (run / LAST).is_file() else None
    except CheckpointError:
        return False
    if header.config != config or header.dataset_sha256 != data.sha256:
        return False
    if header.calibrated != getattr(config.model, "calibrate", False):
        return False
    return header.epoch == 0 or last == config.training.epochs
