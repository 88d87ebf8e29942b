"""Where a run grows: in its folder, or inside it, if it replaces another run.

    RUN/best.safetensors, …                    the old run, which stays until the new one is whole
    RUN/.bsg-replacement/best.safetensors, …   the new one, which `--resume` goes on with

The seal of the new one says that it is whole. Then its files take the place of the old ones. Where
a command is killed meanwhile, the next training brings that to its end.
"""

from __future__ import annotations

import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import refuse_links
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
DISCARDED = ".bsg-discarded"  # what a replacement is called while it is removed
_NAMES = "|".join(re.escape(name) for name in (*FILES, SEAL))
_OWN = re.compile(rf"({MEMBERS}/[^/]+/)?(({_NAMES})|\.({_NAMES})\.partial)|{MEMBERS}/\.[^/]+\.lock")


@contextmanager
def open_run(run: Path, *, resume: bool = False, force: bool = True) -> Iterator[Path]:
    """Hold the lock of a run, yield the folder to train into, and seal it at the end.

    Two trainings never write into one: the second finds the lock, or what the first has made. A run
    that is replaced stays as it is until the new one is whole.

    Args:
        run: its folder, which is made.
        resume: whether to go on with what is there; it has to be what its seal says.
        force: whether to replace a run.

    Yields:
        the folder of the run that grows, as `growing_run` says it; empty of a run unless `resume`.

    Raises:
        TrainingError: if a run, or a file of somebody else's, is in the way.
        DatasetError: if another command holds the lock, or what is gone on with was changed.
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


def growing_run(run: Path) -> Path:
    """Return the folder that a run grows in: its own, or that of a replacement that was begun."""
    replacement = run / REPLACEMENT
    return replacement if replacement.is_dir() and not replacement.is_symlink() else run


def refuse_overwriting(run: Path, *, resume: bool, force: bool) -> None:
    """Refuse a folder that holds a run, unless it is to go on or to be replaced.

    Raises:
        TrainingError: if a run is there, or a file that has a name of ours and is not ours.
        DatasetError: if results of another command are.
    """
    refuse_foreign_files(run)
    holds = has_checkpoint(run) or has_checkpoint(growing_run(run))
    if holds and not (resume or force):
        raise TrainingError(f"{run}: holds a run already; --resume goes on, --force replaces it")


def refuse_foreign_files(run: Path) -> None:
    """Refuse a folder where files that are no run's have the names of a run's.

    Raises:
        TrainingError: naming the first of them.
        DatasetError: if results of another command are there, or it is in a dataset.
    """
    refuse_datasets(Place(run))
    if run.exists() and not run.is_dir():
        raise TrainingError(f"{run}: is a file; a run is a folder")
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
    """Put a replacement that is whole in its place, as a training that was killed would have.

    One that has saved nothing is removed, so that nothing takes the run for it.

    Args:
        run: its folder.
        drop: whether a replacement that was changed since it was whole is to be removed.

    Raises:
        DatasetError: if another command holds the lock, or it cannot be put there.
    """
    if any((run / left).is_dir() for left in (REPLACEMENT, DISCARDED, UNFINISHED)):
        with hold(run):
            _settle(run, drop=drop)


def _begin(run: Path) -> Path:
    """Return an empty folder for a run that starts; a run that has saved anything stays."""
    _remove_replacement(run)
    if not has_checkpoint(run):
        clear_run(run)
        return run
    (run / REPLACEMENT).mkdir()
    return run / REPLACEMENT


def _can_go_on(run: Path) -> bool:
    """Say whether a training that was stopped left what it can go on with."""
    return any(Path(name).name == LAST or name.startswith(MEMBERS) for name in list_run(run))


def _put_in_place(run: Path) -> None:
    """Put a run that has just been sealed in its place, if it is a replacement."""
    try:
        _settle(run)
    except (DatasetError, OSError) as error:
        if growing_run(run) == run:
            raise
        raise TrainingError(
            f"{error}; the finished run is {run / REPLACEMENT}, and the same command with --resume "
            "puts it in its place"
        ) from error


def _settle(run: Path, *, drop: bool = False) -> None:
    """Put a replacement that is whole in its place; what only the old run has is removed."""
    place, replacement = Place(run.resolve(), last=SEAL), growing_run(run)
    try:
        recover([place])
    except OSError as error:
        raise TrainingError(f"{run}: cannot be settled ({error.strerror or error})") from error
    if replacement == run:
        _remove_replacement(run)  # what is left of one
        return
    if not has_checkpoint(replacement):  # killed before there was anything to go on with
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
    """Remove a replacement, if there is one, and what is left of one that was being removed.

    It gets another name first, so that nobody takes half of it for a run to go on with.

    Raises:
        DatasetError: if it is a link, or holds what no training has written.
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
    """Refuse to remove what no training has written."""
    for path in sorted(replacement.rglob("*")):
        place = path.relative_to(replacement).as_posix()
        if path.is_symlink() or (_OWN.fullmatch(place) is None and not path.is_dir()):
            raise DatasetError(f"{path}: was not written by bsg-train; move it away, and run again")
