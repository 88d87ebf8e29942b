"""Watch what a process asks of the disk, call by call, and let the N-th of these calls go wrong.

A seccomp filter sends the calls that touch files to a listener, which sees them before the kernel
does: those of Python, of Arrow's C++ and of Rust, of every thread and of every child process. It
counts the calls below one folder, so that Python's own files, caches and streams are left alone,
and lets each go on, fail with an errno, or never return because the process is dead.
"""

from __future__ import annotations

import ctypes
import errno
import fcntl
import os
import platform
import signal
import struct
import sys
from contextlib import suppress
from dataclasses import dataclass
from typing import Literal

Kind = Literal["write", "sync", "rename", "remove", "make", "create", "open", "read"]
Deed = Literal["nothing", "kill", "tear", "TERM", "INT", "EIO", "ENOSPC"]

CHANGES: tuple[Kind, ...] = ("write", "sync", "rename", "remove", "make", "create")
EVERY: tuple[Kind, ...] = (*CHANGES, "open", "read")
# number of the call on x86-64 → what it does, and where it says to which file: an argument that is
# a descriptor ("f0"), a path ("p0"), or a path below a folder's descriptor ("a0": 0 and 1)
CALLS: dict[int, tuple[Kind, str]] = {
    1: ("write", "f0"),  # write
    18: ("write", "f0"),  # pwrite64
    20: ("write", "f0"),  # writev
    296: ("write", "f0"),  # pwritev
    40: ("write", "f0"),  # sendfile, of shutil
    326: ("write", "f2"),  # copy_file_range
    76: ("write", "p0"),  # truncate
    77: ("write", "f0"),  # ftruncate
    74: ("sync", "f0"),  # fsync
    75: ("sync", "f0"),  # fdatasync
    82: ("rename", "p0p1"),  # rename
    264: ("rename", "a0a2"),  # renameat
    316: ("rename", "a0a2"),  # renameat2
    86: ("rename", "p0p1"),  # link
    265: ("rename", "a0a2"),  # linkat
    87: ("remove", "p0"),  # unlink
    263: ("remove", "a0"),  # unlinkat
    84: ("remove", "p0"),  # rmdir
    83: ("make", "p0"),  # mkdir
    258: ("make", "a0"),  # mkdirat
    2: ("open", "p0"),  # open
    257: ("open", "a0"),  # openat
    0: ("read", "f0"),  # read
    17: ("read", "f0"),  # pread64
}
FLAGS_OF_OPEN = {2: 1, 257: 2}  # which argument has them
AT_FDCWD = 0xFFFFFF9C
_NO_NEW_PRIVILEGES, _SET_FILTER, _NEW_LISTENER, _SECCOMP = 38, 1, 8, 317
_ALLOW, _ASK = 0x7FFF0000, 0x7FC00000
_RECEIVE, _ANSWER, _GO_ON = 0xC0502100, 0xC0182101, 1
_NOTICE = struct.Struct("QIIiIQ6Q")


@dataclass(frozen=True, slots=True)
class Fault:
    """What goes wrong, and when.

    Attributes:
        deed: what happens: the process dies before the call, or after half of a write; it gets a
            signal; or the call fails.
        at: number of the call, from 1, among those of `kinds`; 0 for none.
        kinds: calls that are counted.
        lasting: whether all such calls fail from there on.
    """

    deed: Deed = "nothing"
    at: int = 0
    kinds: tuple[Kind, ...] = CHANGES
    lasting: bool = False


@dataclass(frozen=True, slots=True)
class Call:
    """A call that was counted: what it does, to which file, and to which place a rename leads."""

    kind: Kind
    path: str
    target: str = ""

    def __str__(self) -> str:
        return f"{self.kind} {self.path}" + (f" → {self.target}" if self.target else "")


def can_watch() -> str:
    """Return why calls cannot be watched here, or nothing."""
    if sys.platform != "linux" or platform.machine() != "x86_64":
        return "the numbers of system calls are those of Linux on x86-64"
    return ""


def send_calls(kinds: tuple[Kind, ...]) -> int:
    """Let this process ask before each call that touches a file; return whom it asks."""
    asked = [number for number, (kind, _) in CALLS.items() if _is_asked(kind, kinds)]
    program = struct.pack("HBBI", 0x20, 0, 0, 0)  # load the number of the call
    for left, number in zip(range(len(asked), 0, -1), asked, strict=True):
        program += struct.pack("HBBI", 0x15, left, 0, number)  # equal: to the last line
    program += struct.pack("HBBI", 0x06, 0, 0, _ALLOW) + struct.pack("HBBI", 0x06, 0, 0, _ASK)
    held = ctypes.create_string_buffer(program, len(program))
    head = struct.pack("HxxxxxxQ", len(program) // 8, ctypes.addressof(held))
    libc = ctypes.CDLL(None, use_errno=True)
    if libc.prctl(_NO_NEW_PRIVILEGES, 1, 0, 0, 0):
        raise OSError(ctypes.get_errno(), "prctl")
    listener: int = libc.syscall(_SECCOMP, _SET_FILTER, _NEW_LISTENER, ctypes.c_char_p(head))
    if listener < 0:
        raise OSError(ctypes.get_errno(), "seccomp")
    return listener


def _is_asked(kind: Kind, kinds: tuple[Kind, ...]) -> bool:
    return kind in kinds or (kind == "open" and "create" in kinds)


class Watch:
    """Answers the calls of one process and its children."""

    def __init__(self, listener: int, below: str, fault: Fault, *, group: int) -> None:
        """Watch calls.

        Args:
            listener: what `send_calls` returned, in this process.
            below: folder whose calls are counted.
            fault: what goes wrong.
            group: of processes, which die together.
        """
        self.listener, self.fault, self.group = listener, fault, group
        self.below = below.rstrip("/") + "/"
        self.seen: list[Call] = []
        self.struck = False

    def answer(self) -> None:
        """Take one call in and answer it."""
        notice = bytearray(_NOTICE.size)
        try:
            fcntl.ioctl(self.listener, _RECEIVE, notice)
        except OSError as error:
            if error.errno in (errno.ENOENT, errno.EINTR):  # who asked is dead or interrupted
                return
            raise
        name, pid, _, number, _, _, *words = _NOTICE.unpack(notice)
        code = 0
        call = _look_at(pid, number, words, self.below)
        if call is not None and call.kind in self.fault.kinds:
            self.seen.append(call)
            code = self._strike(call, pid, number, words)
        said = struct.pack("QqiI", name, 0, -code, 0 if code else _GO_ON)
        with suppress(OSError):  # who asked is dead
            fcntl.ioctl(self.listener, _ANSWER, said)

    def _strike(self, call: Call, pid: int, number: int, words: list[int]) -> int:
        """Do what the fault says, if it is time; return the errno of the call."""
        fault, count = self.fault, len(self.seen)
        if not fault.at or count < fault.at or (count > fault.at and not fault.lasting):
            return 0
        self.struck = True
        if fault.deed in ("EIO", "ENOSPC"):
            return int(getattr(errno, fault.deed))
        if fault.deed in ("TERM", "INT"):
            os.kill(self.group, signal.SIGTERM if fault.deed == "TERM" else signal.SIGINT)
        elif fault.deed in ("kill", "tear"):
            if fault.deed == "tear" and number == 1:
                _write_half(pid, words)
            os.killpg(self.group, signal.SIGKILL)
        return 0


def _look_at(pid: int, number: int, words: list[int], below: str) -> Call | None:
    """Return what a call does, if it is to a file below the folder."""
    kind, where = CALLS[number]
    if number in FLAGS_OF_OPEN and words[FLAGS_OF_OPEN[number]] & (os.O_CREAT | os.O_TRUNC):
        kind = "create"
    try:
        paths = [
            _path_of(pid, how, int(word), words)
            for how, word in zip(where[::2], where[1::2], strict=True)
        ]
    except OSError:  # no such descriptor, or the process is dead
        return None
    if not any(path.startswith(below) for path in paths):
        return None
    return Call(kind, *(path.removeprefix(below) for path in paths))


def _path_of(pid: int, how: str, word: int, words: list[int]) -> str:
    if how == "f":
        return os.readlink(f"/proc/{pid}/fd/{words[word]}")  # noqa: PTH115
    path = _read_path(pid, words[word + 1 if how == "a" else word])
    if how == "a" and words[word] & 0xFFFFFFFF != AT_FDCWD:
        folder = os.readlink(f"/proc/{pid}/fd/{words[word]}")  # noqa: PTH115
    else:
        folder = os.readlink(f"/proc/{pid}/cwd")  # noqa: PTH115
    return os.path.normpath(os.path.join(folder, path))  # noqa: PTH118 -- a path may be absolute


def _read_path(pid: int, address: int) -> str:
    with open(f"/proc/{pid}/mem", "rb", buffering=0) as memory:  # noqa: PTH123 -- a hot path
        memory.seek(address)
        text = memory.read(4096 - address % 4096)
        if b"\0" not in text:
            text += memory.read(4096)
    return os.fsdecode(text.partition(b"\0")[0])


def _write_half(pid: int, words: list[int]) -> None:
    """Write half of what a process asks to write: a block that was cut by its death."""
    with open(f"/proc/{pid}/mem", "rb", buffering=0) as memory:  # noqa: PTH123
        memory.seek(words[1])
        data = memory.read(words[2] // 2)
    with open(f"/proc/{pid}/fdinfo/{words[0]}") as info:  # noqa: PTH123
        place = int(info.readline().split()[1])
    descriptor = os.open(f"/proc/{pid}/fd/{words[0]}", os.O_WRONLY)
    try:
        os.pwrite(descriptor, data, place)
    finally:
        os.close(descriptor)
