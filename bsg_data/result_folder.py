"""Replace several result files together, so that new files appear only when all are complete.

`replace_together` writes files that belong together into one folder, into several folders, or
beside each other. A folder may hold other files. New files are first written into a hidden folder
beside their final place, and flushed. After that only renames are left:

    while files are written    the old files, and `.bsg-unfinished` beside them
    while files are renamed    no `last` file, so that no mix of old and new is taken for results
    after the last rename      the new files, and `.bsg-unfinished` with the old ones

An interrupted command undoes its changes. If it was killed, the next command for the same places
undoes them first. Until all renames are done, a folder `own` in the first unfinished folder holds
second names of the new files. By them the next command knows which files it may remove.
"""

from __future__ import annotations

import filecmp
import os
import shutil
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import DatasetError
from bsg_data.files import flush_file, flush_folder, refuse_devices, resolve_links
from bsg_data.lock import hold
from bsg_data.signals import hold_signals

_DATASET = "dataset.json"  # the file by which a dataset is known
UNFINISHED = ".bsg-unfinished"
_NEW, _OLD, _OWN = "new", "old", "own"  # folders in it: what was there has second names in `old`
_DECIDED = ("done", "undone")  # what `own` is called when it is over
SCRATCH = "scratch"  # a folder beside `new`, for what a command writes and reads again
# With the lock of `new`, which a command holds that is called with a folder of another command.
_OURS = (_NEW, _OLD, _OWN, *_DECIDED, SCRATCH, f".{_NEW}.lock")


@dataclass(frozen=True, slots=True)
class Place:
    """The final place of results: a folder or a file.

    Attributes:
        path: path of a folder or of a file.
        is_file: whether it is a file.
        last: for a folder: name of the file that marks complete results. It must be written. It is
            removed before any other file is replaced, and put in place after all others. None if
            the files are independent.
    """

    path: Path
    is_file: bool = False
    last: str | None = None

    @property
    def folder(self) -> Path:
        """The folder of the final files."""
        return self.path.parent if self.is_file else self.path

    @property
    def unfinished(self) -> Path:
        """The hidden folder with new files before, and old files after, the replacement."""
        return self.folder / (f".{self.path.name}{UNFINISHED}" if self.is_file else UNFINISHED)

    @property
    def staged(self) -> Path:
        """The path to write: the new file, or the folder of the new files."""
        return self.unfinished / _NEW / self.path.name if self.is_file else self.unfinished / _NEW


_Path = tuple[Place, str]  # a file: its place, and its path below the folder of that


@contextmanager
def replace_files(folder: Path, *, last: str | None, wait: float = 0.0) -> Iterator[Path]:
    """Lock a folder, yield an empty folder to write into, and put its files in place at the end.

    A missing folder is made. Files in it that the block does not write stay.

    Args:
        folder: folder of the results; a link is followed.
        last: as in `Place`.
        wait: seconds to wait for the current holder of the lock.

    Yields:
        An empty folder; a file at `a/b` in it goes to `a/b` in `folder`.

    Raises:
        DatasetError: if another command is writing there, a link or a folder is in the way, or a
            file cannot be written; old files stay.
        ValueError: if the block does not write `last`.
    """
    with replace_together([Place(resolve_links(folder), last=last)], wait=wait) as (staged,):
        yield staged


@contextmanager
def replace_together(
    places: Sequence[Place], *, refuse: Callable[[], None] | None = None, wait: float = 0.0
) -> Iterator[tuple[Path, ...]]:
    """Lock several places, yield paths to write to, and put all files in place at the end.

    Args:
        places: the places. Only a later command with the same first place undoes the changes of a
            killed command.
        refuse: called after locking and cleaning up, to raise an error if anything is in the way.
        wait: seconds to wait for the current holder of a lock.

    Yields:
        For each place an empty folder to write into, or the path of the file to write. A file that
        is not written is not replaced.

    Raises:
        DatasetError: as `replace_files` does.
        ValueError: if the block does not write `last`.
    """
    with ExitStack() as held:
        hold_places(held, places, wait=wait)
        with stage_files(places, refuse=refuse) as staged:
            yield staged


def hold_places(held: ExitStack, places: Sequence[Place], *, wait: float = 0.0) -> None:
    """Lock places until a stack is closed; make the folders above them.

    Raises:
        DatasetError: if a lock is held, a place is in a dataset, or a folder cannot be made.
    """
    for place in places:
        refuse_datasets(place.path, is_file=place.is_file)
    for place in places:
        try:
            place.path.parent.mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise _explain(place, error, "made") from error
        held.enter_context(hold(place.path, wait=wait))


def refuse_datasets(path: Path, *, is_file: bool = False) -> None:
    """Refuse to write into a dataset, because a dataset lists and hashes all its files.

    Call this before anything is written, also before a lock: its file lies beside the folder.

    Args:
        path: where a command is to write; links on the way are followed.
        is_file: whether it is a file, not a folder.

    Raises:
        DatasetError: naming the dataset.
    """
    folder = resolve_links(path.parent if is_file else path)
    for outer in (folder, *folder.parents):
        if (outer / _DATASET).is_file():
            raise DatasetError(f"{path}: is in the dataset {outer}; choose another place")


@contextmanager
def stage_files(
    places: Sequence[Place],
    *,
    refuse: Callable[[], None] | None = None,
    leaving: Callable[[], Collection[str]] | None = None,
) -> Iterator[tuple[Path, ...]]:
    """Do the work of `replace_together` for a caller that holds the locks already.

    Args:
        places: as in `replace_together`.
        refuse: as in `replace_together`.
        leaving: called when all is written; returns the files of the first place that go when the
            new ones come, by their paths in its folder.
    """
    made = [place.path for place in places if not place.is_file and not place.path.exists()]
    for place in places:
        _refuse_foreign(place.unfinished)
    try:
        for folder in made:
            folder.mkdir(exist_ok=True)
        recover(places)
        if refuse is not None:
            refuse()
        for place in places:
            (place.unfinished / _NEW).mkdir(parents=True)
        yield tuple(place.staged for place in places)
        gone = [] if leaving is None else sorted(leaving())
        with hold_signals():
            _put_in_place(places, gone)
    except OSError as error:
        raise _explain(places[0], error, "written") from error
    finally:
        if not _is_begun(places):  # else it could not be undone: the next command does it
            _clear(places, ignore_errors=True)
        for folder in reversed(made):
            with suppress(OSError):  # it holds files
                folder.rmdir()


def _refuse_foreign(unfinished: Path) -> None:
    """Refuse to remove what no command of ours makes in its folder."""
    if unfinished.is_dir() and not unfinished.is_symlink():
        for path in sorted(unfinished.iterdir()):
            if path.name not in _OURS:
                raise DatasetError(f"{path}: was not written by these commands; move it away")


def is_vacant(folder: Path) -> bool:
    """Say whether a folder is missing, empty, or holds only leftovers of a killed command."""
    if not folder.exists():
        return True
    return folder.is_dir() and {path.name for path in folder.iterdir()} <= {UNFINISHED}


def require_vacant(place: Path) -> None:
    """Refuse to replace results without `--force`.

    Raises:
        DatasetError: naming the place.
    """
    if not is_vacant(place):
        raise DatasetError(f"{place}: is there already; --force replaces it")


def _explain(place: Place, error: OSError, what: str) -> DatasetError:
    return DatasetError(f"{place.path}: cannot be {what} ({error.strerror or error})")


def _put_in_place(places: Sequence[Place], leaving: Sequence[str]) -> None:
    files: list[_Path] = []
    for place in places:
        paths = _list_files(place.unfinished / _NEW)
        if place.last is not None and place.last not in paths:
            raise ValueError(
                f"{place.path}: {place.last}, which says that the files are whole, was not written"
            )
        _refuse_what_is_in_the_way(place.folder, paths)
        files += [(place, path) for path in paths]
    files.sort(key=_is_last)
    for place, path in files:
        flush_file(place.unfinished / _NEW / path)
    gone = [(places[0], path) for path in leaving]
    _keep(places, files, gone)
    done: list[_Path] = []
    try:
        for place in places:
            if place.last is not None:
                (place.folder / place.last).unlink(missing_ok=True)
                flush_folder(place.folder)
        for place, path in gone:
            (place.folder / path).unlink()
        for place, path in files:
            (place.folder / path).parent.mkdir(parents=True, exist_ok=True)
            if _is_last((place, path)):
                _flush_folders(files)  # whatever `last` speaks of is there before it is
            (place.unfinished / _NEW / path).replace(place.folder / path)
            done.append((place, path))
        _flush_folders(files)
        _decide(places, "done")
    except BaseException:
        _undo(places, [*gone, *files], done)
        raise


def _is_last(file: _Path) -> bool:
    return file[1] == file[0].last


def _decide(places: Sequence[Place], how: str) -> None:
    """Let what is begun be over: from now on the next command undoes nothing."""
    with suppress(FileNotFoundError):
        (places[0].unfinished / _OWN).rename(places[0].unfinished / how)


def _is_begun(places: Sequence[Place]) -> bool:
    """Say whether files may have been renamed, and not all."""
    return (places[0].unfinished / _OWN).is_dir()


def recover(places: Sequence[Place]) -> None:
    """Undo the changes of a killed command and remove its leftovers; the caller holds the locks.

    Raises:
        OSError: if it cannot be removed, or is no folder.
        DatasetError: if a link or somebody's own file is in the way.
    """
    for place in places:
        _refuse_foreign(place.unfinished)
    if not places[0].unfinished.is_symlink() and _is_begun(places):
        files: list[_Path] = []
        for place in places:
            if not place.unfinished.is_symlink():
                kept = (_list_files(place.unfinished / name) for name in (_OWN, _OLD))
                paths = sorted(set().union(*kept))
                for folder in (place.folder, place.unfinished / _OLD):
                    _refuse_what_is_in_the_way(folder, paths)
                files += [(place, path) for path in paths]
        _undo(places, sorted(files, key=_is_last))
    _clear(places)


def _undo(places: Sequence[Place], files: Sequence[_Path], done: Collection[_Path] = ()) -> None:
    """Put back what was there; whatever is in a place and is neither old nor new stays."""
    ours = {file for file in files if file in done or _is_own(*file)}
    for place, path in filter(_is_last, ours):  # before its files are no more what it speaks of
        (place.folder / path).unlink(missing_ok=True)
    for place, path in files:
        old, target = place.unfinished / _OLD / path, place.folder / path
        gives_way = (place, path) in ours or not os.path.lexists(target) or _is_alike(place, path)
        if os.path.lexists(old) and gives_way:
            old.replace(target)
        elif (place, path) in ours:
            target.unlink(missing_ok=True)
            _remove_empty(target.parent, place.folder)
    _flush_folders(files)
    _decide(places, "undone")


def _is_own(place: Place, path: str) -> bool:
    """Say whether a file in its place is the one that was put there: it has a second name."""
    with suppress(OSError):
        return os.path.samestat(
            (place.unfinished / _OWN / path).lstat(), (place.folder / path).lstat()
        )
    return False


def _is_alike(place: Place, path: str) -> bool:
    """Say whether a file in its place has the bytes of the one that was put there.

    That is all that is known where the file system has no hard links. Such a file gives way to the
    old one, and is never removed without.
    """
    own, there = place.unfinished / _OWN / path, place.folder / path
    with suppress(OSError):
        return not there.is_symlink() and filecmp.cmp(own, there, shallow=False)
    return False


def _remove_empty(folder: Path, root: Path) -> None:
    """Remove folders that hold nothing, from one up to the one that is given."""
    with suppress(OSError):
        while folder != root:
            folder.rmdir()
            folder = folder.parent


def _list_files(new: Path) -> list[str]:
    """Return the paths of all files below a folder, sorted; a link is nothing to be put anywhere.

    Raises:
        DatasetError: for a link.
    """
    found = sorted(path for path in new.rglob("*") if path.is_symlink() or not path.is_dir())
    for path in found:
        if path.is_symlink():
            raise DatasetError(f"{path.relative_to(new)}: is a link; expected a file")
    return [path.relative_to(new).as_posix() for path in found]


def _refuse_what_is_in_the_way(folder: Path, paths: Sequence[str]) -> None:
    """Refuse a folder where a file goes, and a link on the way there: it may lead anywhere."""
    for path in paths:
        if (folder / path).is_dir() and not (folder / path).is_symlink():
            raise DatasetError(f"{folder / path}: is a folder; expected a file; move it away")
        refuse_devices(folder / path)
        way = (folder / path).parent
        while way != folder:
            if way.is_symlink() or (way.exists() and not way.is_dir()):
                raise DatasetError(
                    f"{way}: expected a folder, found a file or a link; move it away"
                )
            way = way.parent


def _keep(places: Sequence[Place], files: Sequence[_Path], gone: Sequence[_Path]) -> None:
    """Give the files that go or are replaced, and those that replace them, a second name."""
    (places[0].unfinished / _OWN).mkdir()
    for place, path in gone:
        link_or_copy(place.folder / path, place.unfinished / _OLD / path)
    for place, path in files:
        target, unfinished = place.folder / path, place.unfinished
        if os.path.lexists(target):
            link_or_copy(target, unfinished / _OLD / path)
        link_or_copy(unfinished / _NEW / path, unfinished / _OWN / path)


def link_or_copy(source: Path, target: Path) -> None:
    """Hard-link a file, or copy it if links are not supported; make the folders above."""
    target.parent.mkdir(parents=True, exist_ok=True)
    try:
        os.link(source, target, follow_symlinks=False)
    except (OSError, NotImplementedError):  # not on every file system
        shutil.copy2(source, target, follow_symlinks=False)


def _flush_folders(files: Sequence[_Path]) -> None:
    """Have the names of files, and of the folders that were made for them, reach the disk."""
    folders: dict[Path, None] = {}
    for place, path in files:
        for folder in (place.folder / path).parents:
            folders[folder] = None
            if folder == place.folder.parent:
                break
    for folder in folders:
        flush_folder(folder)


def _clear(places: Sequence[Place], *, ignore_errors: bool = False) -> None:
    """Remove what is unfinished, that of the first place last, for it is what tells of the others.

    Args:
        places: of the results.
        ignore_errors: leave what cannot be removed to the next command.

    Raises:
        OSError: if it cannot be removed, or is no folder.
    """
    for place in reversed(places):
        if place.unfinished.is_symlink() or place.unfinished.exists():
            shutil.rmtree(place.unfinished, ignore_errors)  # which refuses a link and a file
