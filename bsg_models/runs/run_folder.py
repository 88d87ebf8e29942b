"""The folder of a run: what may be written there, and when it is finished.

A run grows in its folder, or, if it replaces a finished one, in `UNFINISHED` inside it. Its seal is
written last.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import hold, list_files
from bsg_data.results import (
    SEAL,
    UNFINISHED,
    commit_staged,
    read_seal,
    refuse_datasets,
    refuse_other_results,
    remove_unfinished,
    require_seal,
    write_seal,
)
from bsg_models.errors import TrainingError

BEST, LAST = "best.safetensors", "last.safetensors"
METRICS, CURVE = "metrics.csv", "curve.png"
CONFIG, LOG = "config.toml", "log.jsonl"
MEMBERS = "members"  # folder with the runs of an ensemble's members
_FILES = (SEAL, BEST, LAST, METRICS, CURVE, CONFIG, LOG)  # a folder with a log is a run: it is last
_BEGUN = b'{"event":"begun",'  # first bytes of the log of every run
_SECONDS_TO_WAIT = 10.0  # for another command that adds a file to the run


def checkpoint_of(run: Path) -> Path:
    """Return the best checkpoint of a run; a file is returned as it is."""
    return run / BEST if run.is_dir() else run


@contextmanager
def open_run(run: Path, *, resume: bool = False, force: bool = True) -> Iterator[Path]:
    """Hold the lock of a run, yield its folder to train into, and seal it at the end.

    Two trainings never write into one run: the second finds the lock, or the finished run.

    Args:
        run: its folder, which is created.
        resume: whether to continue what is there; it must match its seal.
        force: whether to replace a run; a finished one stays until the new one is whole.
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
            (place / SEAL).unlink(missing_ok=True)
        else:
            remove_unfinished(run)
            place = run if read_seal(run) is None else run / UNFINISHED
            clear_run(place)
        if place == run:
            remove_unfinished(run)
        place.mkdir(exist_ok=True)
        yield place
        _seal(place)
        if place != run:
            _replace(run)


def finish_replacing(run: Path) -> None:
    """Go on with putting a new run, which is whole, in the place of an old one, after a kill."""
    if read_seal(run / UNFINISHED) is not None:
        with hold(run):
            _replace(run)


def _replace(run: Path) -> None:
    """Put the new run, which is whole and sealed, in the place of the old one."""
    new = {*list_files(run / UNFINISHED)}
    sealed = {*(read_seal(run / UNFINISHED) or ())}
    leaving = {*_list_run(run)} - new if sealed <= new else ()  # one that moved: all has left
    commit_staged(run, leaving=leaving)
    remove_unfinished(run)


def active_folder(run: Path) -> Path:
    """Return the folder that a training of a run goes on in: inside it, if it replaces the run."""
    return run / UNFINISHED if is_run(run / UNFINISHED) else run


@contextmanager
def add_curve(run: Path) -> Iterator[Path]:
    """Hold the lock of a run and yield the path of its curve; its seal lists it afterwards."""
    with hold(run, wait=_SECONDS_TO_WAIT):
        is_sealed = require_seal(run) is not None
        if is_sealed:
            _seal(run, without=CURVE)  # so that a kill leaves no curve that differs from its hash
        yield run / CURVE
        if is_sealed:
            _seal(run)


def _seal(run: Path, *, without: str = SEAL) -> None:
    """Write the seal of a finished run: the hashes of all its files.

    An ensemble's seal also covers its members' files, except their curves: these may be plotted
    later, and a member has its own seal.
    """
    of_members = (SEAL, CURVE)
    names = [
        name
        for name in sorted(_list_run(run))
        if name not in (SEAL, without) and not ("/" in name and name.endswith(of_members))
    ]
    write_seal(run, names)


def refuse_overwriting(run: Path, *, resume: bool, force: bool) -> None:
    """Refuse a folder that holds a run, unless the run is continued or replaced; or other files."""
    refuse_datasets(run)
    refuse_other_results(run, BEST)
    if not is_run(run):
        _refuse_foreign_files(run)
    has_checkpoint = any(name.endswith((BEST, LAST)) for name in _list_run(run))
    if has_checkpoint and not (resume or force):
        message = f"{run}: holds a run already; --resume continues it, --force replaces it"
        raise TrainingError(message, code="run-exists", where=run)


def _refuse_foreign_files(run: Path) -> None:
    """Refuse other files that have the names of a run's files."""
    for name in _FILES:
        path = run / name
        is_empty = path.is_file() and not path.is_symlink() and not path.stat().st_size
        if os.path.lexists(path) and not is_empty:  # a full disk leaves an empty log of ours
            raise TrainingError(
                f"{run / name}: was not written by bsg-train, which would replace it; move it "
                "away, or choose another folder",
                code="foreign-file",
                where=run / name,
            )


def refuse_run(folder: Path) -> None:
    """Refuse to put other results into a run; a stopped run has no seal to recognise it by."""
    if is_run(folder):
        raise DatasetError(f"{folder}: is a run of bsg-train; choose another folder")


def clear_run(run: Path) -> None:
    """Remove the files of a run and its members, and members' folders that become empty."""
    for name in _list_run(run):
        (run / name).unlink()
    for folder in (*(run / MEMBERS).glob("*"), run / MEMBERS):
        with suppress(OSError):
            folder.rmdir()


def _list_run(run: Path) -> list[str]:
    """Return the files of a run and of its members, as paths below its folder; its log is last."""
    members = () if (run / MEMBERS).is_symlink() else sorted((run / MEMBERS).glob("*"))
    runs = [member for member in members if is_run(member) and not member.is_symlink()]
    return [
        (folder / name).relative_to(run).as_posix()
        for folder in (*runs, run)
        for name in _FILES
        if os.path.lexists(folder / name)
    ]


def is_run(folder: Path) -> bool:
    """Return whether a folder was begun by a training, as the first line of its log shows."""
    with suppress(OSError), (folder / LOG).open("rb") as log:
        return log.read(len(_BEGUN)) == _BEGUN
    return False
