"""Lock a folder for one writer; the lock ends with the process that holds it."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from filelock import FileLock, Timeout

from bsg_data.errors import DatasetError
from bsg_data.files import resolve_links


@contextmanager
def hold(folder: Path, *, wait: float = 0.0) -> Iterator[None]:
    """Hold the lock of a folder, which need not exist yet; the folder above it must.

    The lock is `.NAME.lock` beside the folder, so that nothing strange lies in it and that it can
    be renamed while it is locked. The file is removed at the end. One that a killed process left
    behind is not locked, and harms nobody.

    Args:
        folder: folder to lock; it need not exist.
        wait: seconds to wait for the current holder.
    """
    folder = resolve_links(folder)  # a link and what it leads to have one lock
    if not folder.name:
        raise DatasetError(f"{folder}: cannot be written to; choose a folder below it")
    path = folder.with_name(f".{folder.name}.lock")
    if not path.parent.is_dir():  # filelock would make it
        raise DatasetError(f"{path.parent}: no such folder")
    lock = FileLock(path)
    try:
        lock.acquire(timeout=wait)
    except Timeout as error:
        raise DatasetError(
            f"{folder}: another command is writing there; wait until it is done",
            code="folder-busy",
            where=folder,
        ) from error
    except OSError as error:
        if error.errno == errno.ENAMETOOLONG:
            raise DatasetError(f"{folder}: the name is too long; choose a shorter one") from error
        raise DatasetError(
            f"{folder}: cannot be locked by {path} ({error.strerror or error}); to write into a "
            "folder you need permission to write beside it"
        ) from error
    try:
        yield
    finally:
        # Removed while it is held: a process that waits on the removed file opens a new one, for
        # filelock compares the two. A file with content is not ours; filelock 4.1 has emptied it.
        with suppress(OSError):
            if path.stat().st_size == 0:
                path.unlink()
        lock.release()
