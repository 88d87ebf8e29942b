"""Run a function in a process of its own, and kill that at its n-th change to a folder."""

from __future__ import annotations

import os
import select
import signal
import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

from bsg_data.errors import BSGError

# What Python tells of before it does it: each argument may be a path.
CHANGES = ("open", "os.mkdir", "os.remove", "os.rename", "os.rmdir", "os.truncate", "os.link")
SECONDS = 120.0  # after which a process hangs
WRITES = os.O_WRONLY | os.O_RDWR


def snapshot(folder: Path) -> dict[str, bytes | None]:
    """Return every file below a folder with its bytes; None for what is no file."""
    return {
        path.relative_to(folder).as_posix(): path.read_bytes() if path.is_file() else None
        for path in sorted(folder.rglob("*"))
    }


@dataclass(frozen=True)
class Ended:
    """How a process ended: `done`, `refused` by an error of ours, `failed` by another, `killed`."""

    how: str
    message: str = ""  # of the error


def start(work: Callable[[], object], *, inside: Path, kill_at: int | None) -> tuple[int, int]:
    """Begin a function in a copy of this process; return its number and a pipe to read from.

    It is killed before the change of number `kill_at`, from 1 on, inside a folder.
    """
    receive, send = os.pipe()
    process = os.fork()
    if process:
        os.close(send)
        return process, receive
    os.close(receive)
    ended = "failed\nthe process did not come to its end"
    try:
        if kill_at is not None:
            sys.addaudithook(_Killer(str(inside), kill_at).hear)
        work()
        ended = "done\n"
    except BSGError as error:
        ended = f"refused\n{error}"
    except BaseException:
        ended = f"failed\n{traceback.format_exc()}"
    finally:
        os.write(send, ended.encode()[:60_000])
        os._exit(0)  # never back into the test that this is a copy of


def wait_for(process: int, receive: int) -> Ended:
    """Return how a process ended that `start` began; one that hangs is killed, and has failed."""
    said, hangs, deadline = b"", False, time.monotonic() + SECONDS
    while not hangs:
        left = max(deadline - time.monotonic(), 0)
        hangs = not select.select([receive], [], [], left)[0]
        block = b"" if hangs else os.read(receive, 65_536)
        if not block:
            break
        said += block
    os.close(receive)
    if hangs:
        os.kill(process, signal.SIGKILL)
    _, status = os.waitpid(process, 0)
    if hangs:
        return Ended("failed", f"it hangs: {SECONDS:g} s")
    if os.WIFSIGNALED(status):
        return Ended("killed" if os.WTERMSIG(status) == signal.SIGKILL else "failed", str(status))
    how, _, message = said.decode().partition("\n")
    return Ended(how, message)


class _Killer:
    """Kill this process at its n-th change to a folder."""

    def __init__(self, inside: str, left: int) -> None:
        self._inside, self._left = inside, left

    def hear(self, event: str, arguments: tuple[object, ...]) -> None:
        if event not in CHANGES or not any(self._is_inside(one) for one in arguments[:2]):
            return
        if event == "open" and not (isinstance(arguments[2], int) and arguments[2] & WRITES):
            return
        self._left -= 1
        if self._left == 0:
            os.kill(os.getpid(), signal.SIGKILL)

    def _is_inside(self, path: object) -> bool:
        return isinstance(path, str | os.PathLike) and os.fspath(path).startswith(self._inside)
