"""A folder that must stay alone: whoever opens, makes, moves or removes something in it is seen.

Linux tells it (inotify), so that a library that opens files in C++ is seen as well. Elsewhere only
changes are. Who opens the folder itself is not: Python does to see whether it is a link.
"""

from __future__ import annotations

import ctypes
import os
import struct
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

_KINDS = {
    0x002: "written",
    0x004: "changed",
    0x020: "opened",
    0x040: "moved away",
    0x080: "moved in",
    0x100: "made",
    0x200: "removed",
    0x400: "removed",
    0x800: "moved away",
}
_EVENT = struct.Struct("iIII")


@dataclass
class Watched:
    """What happened in a folder, once it is over."""

    events: list[str] = field(default_factory=list)


def snapshot(folder: Path) -> dict[str, bytes | None]:
    """Return every file below a folder with its bytes; None for what is no file."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@contextmanager
def watch(folder: Path) -> Iterator[Watched]:
    """Note what is done in a folder and in the folders in it."""
    seen, before = Watched(), snapshot(folder)
    if sys.platform == "linux":
        with _listen([folder, *(path for path in folder.rglob("*") if path.is_dir())]) as heard:
            yield seen
            seen.events += dict.fromkeys(heard())
    else:
        yield seen
    after = snapshot(folder)
    changed = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    seen.events += [f"{name} is not what it was" for name in sorted(changed)]


@contextmanager
def _listen(folders: list[Path]) -> Iterator[Callable[[], list[str]]]:
    library = ctypes.CDLL(None, use_errno=True)
    descriptor = library.inotify_init1(os.O_NONBLOCK | os.O_CLOEXEC)
    assert descriptor >= 0, os.strerror(ctypes.get_errno())
    try:
        for folder in folders:
            added = library.inotify_add_watch(descriptor, os.fsencode(folder), sum(set(_KINDS)))
            assert added >= 0, os.strerror(ctypes.get_errno())
        yield lambda: _read(descriptor)
    finally:
        os.close(descriptor)


def _read(descriptor: int) -> list[str]:
    try:
        data = os.read(descriptor, 1 << 20)
    except BlockingIOError:
        return []
    events = []
    while data:
        _, mask, _, length = _EVENT.unpack_from(data)
        name = data[_EVENT.size : _EVENT.size + length].rstrip(b"\0").decode(errors="replace")
        if name:
            kinds = [kind for bit, kind in _KINDS.items() if mask & bit]
            events.append(f"{name} was {' and '.join(kinds)}")
        data = data[_EVENT.size + length :]
    return events
