"""Watch what is done in a folder: inotify sees readers, and files are compared for writers."""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_OPENED = 0x020  # by C++ and C libraries, too, which Python's audit events do not tell
_EVENT = struct.Struct("iIII")


def snapshot(folder: Path) -> dict[str, bytes | None]:
    """Return every file below a folder with its bytes; None for what is no file."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@contextmanager
def watch(folder: Path) -> Iterator[list[str]]:
    """Give a list of what is done in a flat folder, which is complete when the context ends."""
    events: list[str] = []
    before = snapshot(folder)
    watcher = _listen(folder) if sys.platform == "linux" else None
    yield events
    if watcher is not None:
        events += dict.fromkeys(_read(watcher))
    after = snapshot(folder)
    changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    events += [f"{name} is not what it was" for name in sorted(changed)]


def _listen(folder: Path) -> int:
    library = ctypes.CDLL(None, use_errno=True)
    descriptor = int(library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC))
    added = library.inotify_add_watch(descriptor, os.fsencode(folder), _OPENED)
    assert min(descriptor, added) >= 0, os.strerror(ctypes.get_errno())
    return descriptor


def _read(descriptor: int) -> Iterator[str]:
    try:
        data = os.read(descriptor, 1 << 20)
    except BlockingIOError:
        data = b""
    finally:
        os.close(descriptor)
    while data:
        *_, length = _EVENT.unpack_from(data)
        name = data[_EVENT.size : _EVENT.size + length].rstrip(b"\0").decode(errors="replace")
        if name:
            yield f"{name} was opened"
        data = data[_EVENT.size + length :]
