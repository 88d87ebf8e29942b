"""One writer at a time: a lock on a folder, which ends with the process that holds it."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bsg_data.errors import DatasetError


@contextmanager
def hold(folder: Path) -> Iterator[None]:
    """Hold the lock of a folder that exists.

    Raises:
        DatasetError: if another process holds it, or the folder is not there.
    """
    try:
        descriptor = os.open(folder, os.O_RDONLY)
    except OSError as error:
        raise DatasetError(f"{folder}: cannot be opened ({error.strerror})") from error
    try:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError as error:
            raise DatasetError(
                f"{folder}: another command is writing there; wait until it is done"
            ) from error
        yield
    finally:
        os.close(descriptor)
