"""Write a run into its folder, or into a subfolder if it replaces another run.

    RUN/best.safetensors, …                    the old run, kept until the new one is complete
    RUN/.bsg-replacement/best.safetensors, …   the new run, which `--resume` continues

The seal of the new run marks it as complete. Then its files replace the old ones. If a command is
killed meanwhile, the next training finishes the replacement.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import AnyPath, refuse_links, resolve_links
from bsg_data.lock import hold
from bsg_data.result_folder import (
    UNFINISHED,
    Place,
    link_or_copy,
    recover,
    refuse_datasets,
    stage_files,
)
from bsg_data.seals import SEAL, refuse_other_results, require_seal
from bsg_data.signals import hold_signals
from bsg_models.errors import TrainingError
from bsg_models.runs.run_folder import (
    BEST,
    FILES,
    LAST,
    MEMBERS,
    clear_run,
    has_checkpoint,
    is_run,
    list_half_written,
    list_run,
    remove_files,
    seal_run,
    unsealed,
)

REPLACEMENT = ".bsg-replacement"
DISCARDED = ".bsg-discarded"  # name of a replacement while it is removed
_NAMES = "|".join(re.escape(name) for name in (*FILES, SEAL))
_OWN = re.compile(rf"({MEMBERS}/[^/]+/)?(({_NAMES})|\.({_NAMES})\.partial)|{MEMBERS}/\.[^/]+\.lock")


@contextmanager
def open_run(run: Path, *, resume: bool = False, force: bool = True) -> Iterator[Path]:
    """Hold the lock of a run, yield the folder to train into, and seal it at the end.

    Two trainings never write into one run: the second finds the lock, or the finished run. A run
    that is replaced stays unchanged until the new one is complete.

    Args:
        run: its folder, which is created.
        resume: whether to continue what is there; it must match its seal.
        force: whether to replace a run.

    Yields:
        The folder to train into, as `growing_run` returns it; without `resume` it holds no run.

    Raises:
        TrainingError: if a run, or a file that bsg-train did not write, is in the way.
        DatasetError: if another command holds the lock, or the run to continue was changed.
    """
    try:
        run.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise TrainingError(f"{run}: cannot be made ({error.strerror})") from error
    with hold(run):
        _settle(run, drop=force and not resume)
        refuse_overwriting(run, resume=resume, force=force)
        remove_files(run, list_half_written(run))
        if resume:
            require_seal(growing_run(run))
        try:
            place = growing_run(run) if resume else _begin(run)
            with unsealed(place):
                yield place
            seal_run(place)
        except BaseException:
            if not _can_go_on(growing_run(run)):
                _remove_replacement(run)
            raise
        _put_in_place(run)


def growing_run(run: AnyPath) -> Path:
    """Return the folder into which a run is trained: its own, or that of a begun replacement."""
    run = Path(run)
    replacement = run / REPLACEMENT
    return replacement if replacement.is_dir() and not replacement.is_symlink() else run


def refuse_overwriting(run: Path, *, resume: bool, force: bool) -> None:
    """Refuse a folder that holds a run, unless the run is continued or replaced.

    Raises:
        TrainingError: if a run is there, or a file with a run's file name that is not of a run.
        DatasetError: if results of another command are there.
    """
    refuse_foreign_files(run)
    holds = has_checkpoint(run) or has_checkpoint(growing_run(run))
    if holds and not (resume or force):
        raise TrainingError(
            f"{run}: holds a run already; --resume continues it, --force replaces it"
        )


def refuse_foreign_files(run: Path) -> None:
    """Refuse a folder where other files have the names of a run's files.

    Raises:
        TrainingError: naming the first of them.
        DatasetError: if results of another command are there, or the folder is in a dataset.
    """
    refuse_datasets(run)
    if run.exists() and not run.is_dir():
        raise TrainingError(f"{run}: is a file; expected a folder for the run")
    refuse_other_results(run, BEST)
    if is_run(run):
        return
    for name in (*FILES, SEAL):
        if (run / name).exists() or (run / name).is_symlink():
            raise TrainingError(
                f"{run / name}: was not written by bsg-train, which would replace it; move it "
                "away, or choose another folder"
            )


def settle_run(run: Path, *, drop: bool = False) -> None:
    """Put a complete replacement in its place, as the killed training would have done.

    A replacement that has saved nothing is removed.

    Args:
        run: its folder.
        drop: whether to remove a replacement that was changed after it was complete.

    Raises:
        DatasetError: if another command holds the lock, or the files cannot be moved.
    """
    if any((run / left).is_dir() for left in (REPLACEMENT, DISCARDED, UNFINISHED)):
        with hold(run):
            _settle(run, drop=drop)


def _begin(run: Path) -> Path:
    """Return an empty folder for a new run; a run that has saved anything stays."""
    _remove_replacement(run)
    if not has_checkpoint(run):
        clear_run(run)
        return run
    (run / REPLACEMENT).mkdir()
    return run / REPLACEMENT


def _can_go_on(run: Path) -> bool:
    """Return whether a stopped training left something to continue."""
    return any(Path(name).name == LAST or name.startswith(MEMBERS) for name in list_run(run))


def _put_in_place(run: Path) -> None:
    """Put a run that has just been sealed in its place, if it is a replacement."""
    try:
        _settle(run)
    except (DatasetError, OSError) as error:
        if growing_run(run) == run:
            raise
        raise TrainingError(
            f"{error}; the finished run is {run / REPLACEMENT}; repeat the command with --resume "
            "to put it in its place"
        ) from error


def _settle(run: Path, *, drop: bool = False) -> None:
    """Put a complete replacement in its place, and remove what only the old run has."""
    place, replacement = Place(resolve_links(run), last=SEAL), growing_run(run)
    try:
        recover([place])
    except OSError as error:
        raise TrainingError(f"{run}: cannot be settled ({error.strerror or error})") from error
    if replacement == run:
        _remove_replacement(run)  # the rest of a removal that was stopped
        return
    if not has_checkpoint(replacement):  # killed before it saved anything
        _remove_replacement(run)
        return
    try:
        if require_seal(replacement) is None:
            return
    except DatasetError:
        if not drop:
            raise
        _remove_replacement(run)
        return
    old, new = list_run(run), list_run(replacement)
    with hold_signals():
        with stage_files([place]) as (staged,):
            for name in new:
                link_or_copy(replacement / name, staged / name)
        remove_files(run, [name for name in old if name not in new])
        _remove_replacement(run)


def _remove_replacement(run: Path) -> None:
    """Remove a replacement, and the rest of one whose removal was stopped.

    It is renamed first, so that a half-removed replacement is never continued.

    Raises:
        DatasetError: if it is a link, or holds files that no training wrote.
    """
    discarded = run / DISCARDED
    for folder in (discarded, run / REPLACEMENT):
        refuse_links(run, folder)
        if folder.exists() and not folder.is_dir():
            raise DatasetError(f"{folder}: was not written by bsg-train; move it away")
        if folder.is_dir():
            _refuse_foreign(folder)
            folder.replace(discarded)
            shutil.rmtree(discarded)


def _refuse_foreign(replacement: Path) -> None:
    """Refuse to remove files that no training wrote."""
    for path in sorted(replacement.rglob("*")):
        place = path.relative_to(replacement).as_posix()
        if path.is_symlink() or (_OWN.fullmatch(place) is None and not path.is_dir()):
            raise DatasetError(f"{path}: was not written by bsg-train; move it away, and run again")
