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

_DIE_WITH_PARENT = 1  # of prctl
FOLDER = str(Path(__file__).resolve().parent)
START = f"import sys; sys.path.insert(0, {FOLDER!r}); import fork_server; fork_server.serve()"
SECONDS = 120.0  # after which a command hangs
SECONDS_BESIDE = 60.0  # more, after which the process that runs commands hangs itself


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


class HangError(Exception):
    """The process that imports our commands did not come so far as to run one."""


class ForkServer:
    """A process that has imported our commands; one that hangs is killed, and the next begins."""

    def __init__(
        self,
        modules: Sequence[str],
        *,
        under: Sequence[str] = (),
        seconds: float = SECONDS,
        seconds_beside: float = SECONDS_BESIDE,
    ) -> None:
        """Start it.

        Args:
            modules: what it imports.
            under: words of a program that starts it, as `fiu-run -x`.
            seconds: after which a command hangs.
            seconds_beside: more, after which this process itself hangs.
        """
        self._seconds, self._patience = seconds, seconds + seconds_beside
        self._modules, self._under = tuple(modules), tuple(under)
        self._begin()

    def _begin(self) -> None:
        """Start the process, and wait until everything is imported.

        Raises:
            HangError: if it is not.
        """
        threads = {f"{name}_NUM_THREADS": "1" for name in ("OMP", "OPENBLAS", "MKL")}
        # A thread that starts while Arrow is loaded waits for the loader, holding libfiu's lock,
        # for which the loader waits: of Arrow's allocator there is to be none.
        quiet = {"JE_ARROW_MALLOC_CONF": "background_thread:false"}
        self._process = subprocess.Popen(
            [*self._under, sys.executable, "-c", START, *self._modules],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            bufsize=0,
            env={**os.environ, **threads, **quiet, "MPLBACKEND": "agg"},
        )
        if self._hear(self._patience) is None:
            self.close()
            raise HangError(f"{self._modules} were not imported in time; nothing was tried")

    def _hear(self, seconds: float) -> dict[str, Any] | None:
        """Return what the process says next; None if it says nothing for so long, or is dead."""
        assert self._process.stdout is not None
        said, deadline = b"", time.monotonic() + seconds
        while not said.endswith(b"\n"):
            left = max(deadline - time.monotonic(), 0)
            if not select.select([self._process.stdout], [], [], left)[0]:
                return None
            block = self._process.stdout.read(2**16)
            if not block:
                return None
            said += block
        told: dict[str, Any] = json.loads(said)
        return told

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
            "seconds": self._seconds,
            "chance": None if chance is None else asdict(chance),
        }
        if self._process.poll() is not None:  # the one before hung
            self._begin()
        assert self._process.stdin is not None
        self._process.stdin.write(json.dumps(asked).encode() + b"\n")
        told = self._hear(self._patience)
        if told is None:
            self.close()
            return Ended(None, "the process that runs commands hung with it, or died")
        calls = tuple(Call(*call) for call in told["calls"])
        return Ended(told["code"], told["said"], calls, told["struck"])


def serve() -> None:
    """Import the modules that are named, then run a command for each line on stdin."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    for module in sys.argv[1:]:
        importlib.import_module(module)
    answers.write(b"{}\n")  # everything is imported
    answers.flush()
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
    code, watch = _wait_for(child, folder, fault, ours, seconds=asked["seconds"])
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
        ctypes.CDLL(None).prctl(_DIE_WITH_PARENT, signal.SIGKILL)
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
        sys.argv = asked["words"]
        main = importlib.import_module(f"bsg_cli.{sys.argv[0].removeprefix('bsg-')}").main
        if asked["chance"] is not None:
            _fail_at_random(Chance(**asked["chance"]))
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
    child: int, folder: Path, fault: Fault | None, ours: socket.socket, *, seconds: float
) -> tuple[int | None, Watch | None]:
    """Answer the calls of a command until it ends; return its exit code."""
    watch, end = None, os.pidfd_open(child)
    listener = None if fault is None else _receive(ours)
    if fault is not None and listener is not None:
        watch = Watch(listener, str(folder), fault, group=child)
    deadline = time.monotonic() + seconds
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
    signal.pidfd_send_signal(end, signal.SIGKILL)  # if it was no group of its own yet
    _, status = os.waitpid(child, 0)
    os.close(end)
    if watch is not None:
        os.close(watch.listener)
    return (None if hung else os.waitstatus_to_exitcode(status)), watch


def _receive(ours: socket.socket) -> int | None:
    """Return who hears the calls of a command; None if it ended, or hangs, before it said so."""
    ours.settimeout(SECONDS_BESIDE)
    with suppress(TimeoutError):
        _, received, _, _ = socket.recv_fds(ours, 1, 1)
        return received[0] if received else None
    return None
