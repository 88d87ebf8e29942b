"""Run our commands in forks of one process that has imported them: a case costs no imports.

server = ForkServer(("bsg_cli.data",))
ended = server.run(["bsg-data", "split", "dataset"], folder, Fault("kill", at=3))
"""

from __future__ import annotations

import atexit
import ctypes
import importlib
import io
import json
import os
import resource
import select
import signal
import socket
import subprocess
import sys
import time
import traceback
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Any

from system_calls import Call, Fault, Watch, send_calls

FOLDER = str(Path(__file__).resolve().parent)
START = f"import sys; sys.path.insert(0, {FOLDER!r}); import fork_server; fork_server.serve()"
SECONDS = 120.0  # after which a command hangs


@dataclass(frozen=True, slots=True)
class Ended:
    """How a command ended.

    Attributes:
        code: exit code; of a signal it is negative, and None stands for a command that hung.
        said: what it wrote on stderr.
        calls: those that were counted.
        struck: whether the fault came, before the command was through.
    """

    code: int | None
    said: str
    calls: tuple[Call, ...] = ()
    struck: bool = False


@dataclass(frozen=True, slots=True)
class Chance:
    """Calls of the C library that fail at random, wherever the file is, as libfiu names them."""

    names: tuple[str, ...]
    probability: float
    seed: int


class ForkServer:
    """A process that has imported our commands."""

    def __init__(self, modules: Sequence[str], *, under: Sequence[str] = ()) -> None:
        """Start it.

        Args:
            modules: what it imports.
            under: words of a program that starts it, as `fiu-run -x`.
        """
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
        self._process = subprocess.Popen(
            [*under, sys.executable, "-c", START, *modules],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            env={**os.environ, **threads, "MPLBACKEND": "agg"},
        )

    def close(self) -> None:
        """End it."""
        self._process.kill()
        self._process.communicate()

    def run(
        self,
        words: Sequence[str],
        folder: Path,
        fault: Fault | None = None,
        *,
        memory: int | None = None,
        chance: Chance | None = None,
    ) -> Ended:
        """Run a command in a folder, whose files are watched if there is a fault.

        Args:
            words: of the command line.
            folder: where it runs.
            fault: what goes wrong; None watches nothing.
            memory: bytes of address space that it may take beyond those of its imports.
            chance: what fails at random, of a server under `fiu-run`.
        """
        asked = {
            "words": list(words),
            "folder": str(folder),
            "fault": None if fault is None else asdict(fault),
            "memory": memory,
            "chance": None if chance is None else asdict(chance),
        }
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(json.dumps(asked).encode() + b"\n")
        self._process.stdin.flush()
        told = json.loads(self._process.stdout.readline())
        calls = tuple(Call(*call) for call in told["calls"])
        return Ended(told["code"], told["said"], calls, told["struck"])


def serve() -> None:
    """Import the modules that are named, then run a command for each line on stdin."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    for module in sys.argv[1:]:
        importlib.import_module(module)
    while line := sys.stdin.buffer.readline():
        answers.write(json.dumps(_serve_one(json.loads(line))).encode() + b"\n")
        answers.flush()


def _serve_one(asked: dict[str, Any]) -> dict[str, Any]:
    folder = Path(asked["folder"])
    imports = folder.with_name(f"{folder.name}.imports")
    said = os.memfd_create("stderr")  # no file, for its disk may be full
    fault = None if asked["fault"] is None else Fault(**asked["fault"])
    ours, theirs = socket.socketpair()
    child = os.fork()
    if child == 0:
        ours.close()
        _be_command(asked, folder, imports, said, fault, theirs)
    theirs.close()
    code, watch = _wait_for(child, folder, fault, ours)
    ours.close()
    _import_as_well(imports)
    with os.fdopen(said, "rb") as file:
        file.seek(0)
        text = file.read().decode("utf-8", errors="replace")
    return {
        "code": code,
        "said": text,
        "calls": [] if watch is None else [(c.kind, c.path, c.target) for c in watch.seen],
        "struck": watch is not None and watch.struck,
    }


def _import_as_well(listed: Path) -> None:
    """Import what a command had to, so that later ones find it."""
    if listed.is_file():
        for module in listed.read_text().splitlines():
            if module not in sys.modules:
                with suppress(Exception):  # what is no module, or imports only after another
                    importlib.import_module(module)
        listed.unlink()


def _be_command(
    asked: dict[str, Any],
    folder: Path,
    imports: Path,
    said: int,
    fault: Fault | None,
    theirs: socket.socket,
) -> None:
    """Become the command; never return."""
    code = 1
    try:
        os.setsid()
        os.chdir(folder)
        null = os.open(os.devnull, os.O_RDWR)
        for source, target in ((null, 0), (null, 1), (said, 2)):
            os.dup2(source, target)
        if asked["memory"] is not None:
            pages = int(Path("/proc/self/statm").read_text().split()[0])
            limit = pages * resource.getpagesize() + asked["memory"]
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
        if fault is not None:
            listener = send_calls(tuple(fault.kinds))
            socket.send_fds(theirs, [b"!"], [listener])
            os.close(listener)
        theirs.close()
        if asked["chance"] is not None:
            _fail_at_random(Chance(**asked["chance"]))
        sys.argv = asked["words"]
        main = importlib.import_module(f"bsg_cli.{sys.argv[0].removeprefix('bsg-')}").main
        main()
        code = 0
    except SystemExit as error:
        code = error.code if isinstance(error.code, int) else 1
    except BaseException:
        with suppress(BaseException):
            traceback.print_exc()
    finally:
        with suppress(BaseException):
            if code == 0 and fault is None and asked["memory"] is asked["chance"] is None:
                imports.write_text("\n".join(sys.modules))
            atexit._run_exitfuncs()
            sys.stderr.flush()
        os._exit(code)


def _fail_at_random(chance: Chance) -> None:
    """Let calls fail; what is said is kept until they do so no more, since it is written, too."""
    fiu = ctypes.CDLL("libfiu.so.0")  # which fiu-run has loaded before anything else
    fiu.fiu_init(0)
    fiu.fiu_set_prng_seed(chance.seed)
    said = sys.stderr = io.StringIO()

    def end() -> None:
        for name in chance.names:
            fiu.fiu_disable(name.encode())
        os.write(2, said.getvalue().encode())

    atexit.register(end)
    for name in chance.names:
        share = ctypes.c_float(chance.probability)
        fiu.fiu_enable_random(name.encode(), 1, None, 0, share)


def _wait_for(
    child: int, folder: Path, fault: Fault | None, ours: socket.socket
) -> tuple[int | None, Watch | None]:
    """Answer the calls of a command until it ends; return its exit code."""
    watch, end = None, os.pidfd_open(child)
    if fault is not None:
        _, received, _, _ = socket.recv_fds(ours, 1, 1)
        watch = Watch(received[0], str(folder), fault, group=child)
    deadline = time.monotonic() + SECONDS
    while time.monotonic() < deadline:
        asked = select.poll()
        asked.register(end, select.POLLIN)
        if watch is not None:
            asked.register(watch.listener, select.POLLIN)
        happened = [descriptor for descriptor, event in asked.poll(1000) if event & select.POLLIN]
        if watch is not None and watch.listener in happened:
            watch.answer()
        elif end in happened:
            break
    hung = time.monotonic() >= deadline
    with suppress(ProcessLookupError, PermissionError):
        os.killpg(child, signal.SIGKILL)  # workers that live on, or all of it
    _, status = os.waitpid(child, 0)
    os.close(end)
    if watch is not None:
        os.close(watch.listener)
    return (None if hung else os.waitstatus_to_exitcode(status)), watch
