"""A folder of results whose files change together: none is seen before all are whole.

`replace_files` is the one way to write several files that belong together into a folder that may
hold other things. New files are written into a folder of their own inside it, and flushed; only
renames are left then. A killed command leaves one of these, and the next one removes the rest:

    while files are written    the old files, and `.bsg-unfinished` beside them
    while files are renamed    no `last` file, so that no mix of old and new is taken for results
    after the last rename      the new files, and `.bsg-unfinished` with the old ones

Whatever stops a command in another way is undone.
"""

from __future__ import annotations

import os
import shutil
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import flush_file, flush_folder
from bsg_data.lock import hold

UNFINISHED = ".bsg-unfinished"


@contextmanager
def replace_files(folder: Path, *, last: str | None, wait: float = 0.0) -> Iterator[Path]:
    """Hold the lock of a folder, yield one to write into, and put its files in place at the end.

    The folder is made where it is missing. Files in it that the block does not write stay.

    Args:
        folder: of the results; through a link, what it leads to.
        last: the file that says that results are there, which the block has to write: removed
            before any other is replaced, and renamed to its place after all others. None where
            each file stands for itself.
        wait: seconds to wait for whoever holds the lock.

    Yields:
        An empty folder; a file at `a/b` in it goes to `a/b` in `folder`.

    Raises:
        DatasetError: if another command is writing there, a link or a folder is in the way, or a
            file cannot be written; what was there stays.
        ValueError: if the block does not write `last`.
    """
    folder = folder.resolve()
    try:
        folder.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be made ({error.strerror or error})") from error
    with hold(folder, wait=wait), stage_files(folder, last=last) as staged:
        yield staged


@contextmanager
def stage_files(folder: Path, *, last: str | None) -> Iterator[Path]:
    """Do what `replace_files` does for somebody who holds the folder's lock already."""
    unfinished = folder / UNFINISHED
    made = not folder.exists()
    _refuse_foreign(unfinished)
    try:
        folder.mkdir(exist_ok=True)
        _remove(unfinished)  # of a killed command
        (unfinished / "new").mkdir(parents=True)
        yield unfinished / "new"
        _put_in_place(unfinished, folder, last=last)
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be written ({error.strerror or error})") from error
    finally:
        with suppress(OSError):
            _remove(unfinished)
        if made:
            with suppress(OSError):  # it holds files
                folder.rmdir()


def is_vacant(folder: Path) -> bool:
    """Say whether nothing is in a place but what a killed command may have left."""
    if not folder.exists():
        return True
    return folder.is_dir() and {path.name for path in folder.iterdir()} <= {UNFINISHED}


def _put_in_place(unfinished: Path, folder: Path, *, last: str | None) -> None:
    new, old = unfinished / "new", unfinished / "old"
    paths = _list_files(new)
    if last is not None and last not in paths:
        raise ValueError(f"{folder}: {last}, which says that the files are whole, was not written")
    paths.sort(key=lambda path: path == last)
    _refuse_what_is_in_the_way(folder, paths)
    for path in paths:
        flush_file(new / path)
    kept = _keep(folder, paths, old)
    done: list[str] = []
    try:
        if last is not None:
            (folder / last).unlink(missing_ok=True)
            flush_folder(folder)
        for path in paths:
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            if path == last:
                _flush_folders(folder, paths)  # whatever `last` speaks of is there before it is
            (new / path).replace(folder / path)
            done.append(path)
        _flush_folders(folder, paths)
    except BaseException:
        for path in {*done, *kept}:
            if path in kept:
                (old / path).replace(folder / path)
            else:
                (folder / path).unlink(missing_ok=True)
        raise


def _list_files(new: Path) -> list[str]:
    """Return the paths of all files below a folder, sorted; a link is nothing to be put anywhere.

    Raises:
        DatasetError: for a link.
    """
    found = sorted(path for path in new.rglob("*") if path.is_symlink() or not path.is_dir())
    for path in found:
        if path.is_symlink():
            raise DatasetError(f"{path.relative_to(new)}: is a link, and results are files")
    return [path.relative_to(new).as_posix() for path in found]


def _refuse_what_is_in_the_way(folder: Path, paths: Sequence[str]) -> None:
    """Refuse a folder where a file goes, and a link on the way there: it may lead anywhere."""
    for path in paths:
        if (folder / path).is_dir() and not (folder / path).is_symlink():
            raise DatasetError(f"{folder / path}: is a folder, where a file goes; move it away")
        way = (folder / path).parent
        while way != folder:
            if way.is_symlink() or (way.exists() and not way.is_dir()):
                raise DatasetError(f"{way}: is no folder, where files go; move it away")
            way = way.parent


def _keep(folder: Path, paths: Sequence[str], old: Path) -> set[str]:
    """Give the files that will be replaced a second name, so that they can be put back."""
    kept = set()
    for path in paths:
        if (folder / path).is_symlink() or (folder / path).exists():
            (old / path).parent.mkdir(parents=True, exist_ok=True)
            try:
                os.link(folder / path, old / path, follow_symlinks=False)
            except (OSError, NotImplementedError):  # not on every file system
                shutil.copy2(folder / path, old / path, follow_symlinks=False)
            kept.add(path)
    return kept


def _flush_folders(folder: Path, paths: Sequence[str]) -> None:
    for inner in {(folder / path).parent for path in paths}:
        flush_folder(inner)


def _refuse_foreign(unfinished: Path) -> None:
    """Refuse to remove what no command of ours makes in its folder."""
    if unfinished.is_dir() and not unfinished.is_symlink():
        for path in sorted(unfinished.iterdir()):
            if path.name not in ("new", "old"):
                raise DatasetError(f"{path}: was not written by these commands; move it away")


def _remove(unfinished: Path) -> None:
    """Remove what a command left.

    Raises:
        OSError: if it cannot be removed, or is no folder.
    """
    if unfinished.is_symlink() or unfinished.exists():
        shutil.rmtree(unfinished)  # which refuses a link and a file
