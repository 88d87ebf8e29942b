"""Write files complete or not at all, by a rename, and lock folders for one writer."""

from __future__ import annotations

import json
import os
import re
import shutil
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, Final, TypeAlias

from bsg_data.errors import BSGError, DatasetError

AnyPath: TypeAlias = "str | os.PathLike[str]"  # what a public function takes for a path
# Settings of matplotlib for all figures: names are shown as they are, a $ as a $.
PLAIN_TEXT: Final[dict[Any, Any]] = {"text.usetex": False, "text.parse_math": False}


class FigureError(BSGError):
    """Report a figure that cannot be drawn, though its file could be written."""


def resolve_links(path: AnyPath) -> Path:
    """Return the absolute path without links."""
    return Path(os.path.realpath(path))


@contextmanager
def open_beside(path: Path) -> Iterator[Path]:
    """Yield a path beside a file's final path; rename it there when the block succeeds.

    A missing folder is made. The old file at `path` stays until the rename, and stays for good if
    the block raises. The data are flushed before the rename, and the name before the function
    returns.
    """
    refuse_device(path)
    partial = path.with_name(f".{path.name}.partial")
    with writing(path):
        try:
            path.parent.mkdir(parents=True, exist_ok=True)
            partial.unlink(missing_ok=True)  # of a killed command; a link there is never followed
            yield partial
            flush_file(partial)
            partial.replace(path)
        except BaseException:
            partial.unlink(missing_ok=True)
            raise
        flush_folder(path.parent)


@contextmanager
def writing(path: Path) -> Iterator[None]:
    """Turn an error of the disk into one of ours."""
    try:
        yield
    except OSError as error:
        message = f"{path}: cannot be written ({error.strerror or error})"
        raise DatasetError(message, code="not-written", where=path) from error


def write_bytes(path: Path, data: bytes) -> None:
    """Write a small file beside its final path and rename it there.

    Raises:
        DatasetError: if it cannot be written; an old file stays.
    """
    with open_beside(path) as partial, partial.open("xb") as file:
        file.write(data)


def write_figure(figure: Any, path: Path, **how: Any) -> None:
    """Draw a figure of matplotlib as `open_beside` does; the suffix names its format."""
    if not path.suffix:  # matplotlib would take another path
        raise BSGError(f"{path}: no suffix names the format of the figure; take {path}.png")
    kind = path.suffix[1:]
    try:
        with open_beside(path) as partial:
            figure.savefig(partial, format=kind, **how)
    except (ValueError, RuntimeError) as error:  # it lists what it knows; .pgf needs LaTeX
        raise FigureError(f"{path}: the figure cannot be written ({error})") from error


@contextmanager
def noting_failures(notes: list[str]) -> Iterator[None]:
    """Add a note if the figure of the block cannot be drawn, so that finished work is kept."""
    try:
        yield
    except FigureError as error:
        notes.append(f"note: a figure is missing: {error}")


def encode_json(value: object, **style: Any) -> str:
    """Return a value as JSON; refuse NaN and infinity. All JSON of this project is made here."""
    try:
        return json.dumps(value, allow_nan=False, **style)  # noqa: TID251
    except ValueError as error:
        raise DatasetError(
            f"a computed number is not finite, which JSON cannot hold ({error}); nothing was "
            "written; please report this"
        ) from error


def stem_of(name: str) -> str:
    """Return a name as the stem of a file; all but letters, digits, - _ and . become -.

    >>> stem_of("ceci (second)"), stem_of("../owner/name")
    ('ceci-second', 'owner-name')
    """
    return re.sub(r"[^\w.-]+", "-", name).strip("-.") or "-"


def refuse_device(path: Path) -> None:
    """Refuse to write over a device or a pipe: a rename would replace it."""
    if path.exists() and not (path.is_file() or path.is_dir()):
        raise DatasetError(f"{path}: is a device or a pipe; expected a file or a free path")


def remove(path: Path) -> None:
    """Remove a file, a link or a folder with all in it, if it is there."""
    if path.is_dir() and not path.is_symlink():
        shutil.rmtree(path)
    else:
        path.unlink(missing_ok=True)


def empty(folder: Path, *, but: str = "") -> None:
    """Make a folder, or remove all in it but for one name."""
    if folder.is_symlink() or folder.is_file():
        folder.unlink()
    folder.mkdir(parents=True, exist_ok=True)
    for path in folder.iterdir():
        if path.name != but:
            remove(path)


def list_files(folder: Path) -> list[str]:
    """Return the sorted relative paths of all files and links below a folder."""
    found = (path for path in folder.rglob("*") if path.is_symlink() or not path.is_dir())
    return sorted(path.relative_to(folder).as_posix() for path in found)


def refuse_links(root: Path, path: Path) -> None:
    """Refuse a path below a folder if a link is on the way, because it may lead anywhere.

    Args:
        root: the folder that the user named; it may be a link itself.
        path: a path below it, existing or not.
    """
    for step in (path, *path.parents):
        if step == root:
            return
        if step.is_symlink():
            raise DatasetError(
                f"{step}: is a link, and this program does not write through links; remove it"
            )


def flush_file(path: Path) -> None:
    """Flush the data of a file to the disk."""
    descriptor = os.open(path, os.O_RDWR)  # Windows flushes only what is open for writing
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)


def flush_folder(path: Path) -> None:
    """Flush the names in a folder to the disk, if the system supports it."""
    with suppress(OSError):
        descriptor = os.open(path, os.O_RDONLY)
        try:
            os.fsync(descriptor)
        finally:
            os.close(descriptor)


@contextmanager
def hold(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder, which need not exist yet; the folder above it must.

    The lock is `.NAME.lock` beside the folder, so that nothing strange lies in it and that it can
    be renamed while it is locked. The file is removed at the end. One that a killed process left
    behind is not locked, and harms nobody.
    """
    folder = resolve_links(folder)  # a link and what it leads to have one lock
    path = folder.parent / f".{folder.name}.lock"
    if not path.parent.is_dir():  # filelock would make it
        raise DatasetError(f"{path.parent}: no such folder")
    from filelock import FileLock, Timeout  # questions lock nothing

    lock = FileLock(path)
    try:
        lock.acquire(timeout=0)
    except Timeout as error:
        raise DatasetError(
            f"{folder}: another command is writing there; wait until it is done",
            code="folder-busy",
            where=folder,
        ) from error
    except OSError as error:
        raise DatasetError(
            f"{folder}: cannot be locked by {path} ({error.strerror or error}); to write into a "
            "folder you need permission to write beside it"
        ) from error
    try:
        yield
    finally:
        # Removed while it is held: a process that waits on the removed file opens a new one, for
        # filelock compares the two.
        with suppress(OSError):
            path.unlink()
        lock.release()
