"""Exit codes, errors, progress bars and the worker pool of all commands.

Results go to stdout, as text or with `--json` as JSON. Progress, notes and errors go to stderr.
Exit codes: 0 done, 1 failed or found faults, 2 wrong usage, 130 interrupted, 143 asked to end.
"""

from __future__ import annotations

import os
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from io import TextIOWrapper
from types import FrameType
from typing import TYPE_CHECKING, Any, NoReturn

import click
from pydantic import ValidationError

from bsg_data.errors import EXTRA_OF, BSGError, RecipeError, ask_to_install
from bsg_data.files import encode_json
from bsg_data.records import name_fault
from bsg_data.tables import is_obeyed, make_line, make_plain

if TYPE_CHECKING:
    from concurrent.futures import Executor

FAILED, WRONG_USAGE, INTERRUPTED, ENDED = 1, 2, 130, 143
SECONDS_BETWEEN_LINES = 30.0  # of progress, where no bar can be drawn


_Progress = Callable[..., None]  # called with units done, units in all, and a few words about them


class _AskedToEndError(KeyboardInterrupt):
    """SIGTERM came, as from a cluster or a shutdown; it is handled like Ctrl-C."""


class Command(click.Command):
    """A command with `-h`, `--version` and the exit codes of this project."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        click.version_option(package_name="belief-scene-graphs")(self)

    def get_help_option_names(self, ctx: click.Context) -> list[str]:
        """Return `-h` and `--help`, whatever the context: click keeps what the first one said."""
        return ["-h", "--help"]

    def main(self, *args: Any, **kwargs: Any) -> NoReturn:
        """Run the command and exit with one of the five exit codes.

        Errors of the libraries become messages.
        """
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # a terminal may lack a letter of a name
                stream.reconfigure(errors="replace")
        try:
            kwargs["standalone_mode"] = False
            with _ended_in_order():
                code = super().main(*args, **kwargs)
        except click.ClickException as error:
            error.message = make_plain(error.message)  # type: ignore[misc]
            error.show()
            sys.exit(error.exit_code)
        except (click.Abort, KeyboardInterrupt) as error:  # click turns Ctrl-C into Abort
            asked = isinstance(error.__cause__ or error, _AskedToEndError)
            print_note("asked to end" if asked else "interrupted")
            sys.exit(ENDED if asked else INTERRUPTED)
        except (BSGError, ValidationError, MemoryError, ModuleNotFoundError, OSError) as error:
            if isinstance(error, ModuleNotFoundError) and not _is_of_extra(error):
                raise
            print_note(f"Error: {_describe_error(error)}")
            wrong = isinstance(error, RecipeError | ValidationError)  # a request refuses its values
            sys.exit(WRONG_USAGE if wrong else FAILED)
        sys.exit(code if isinstance(code, int) else 0)


class CommandGroup(Command, click.Group):
    """A group of commands."""

    command_class = Command


def _describe_error(error: Exception) -> str:
    if isinstance(error, ValidationError):
        return name_fault(error)
    if isinstance(error, MemoryError):
        return "not enough memory; free some, or give the command fewer --workers if it has any"
    if isinstance(error, ModuleNotFoundError) and "pip install" not in str(error):
        missing = str(error.name).partition(".")[0]
        return f"{missing} is not installed; this needs it: {ask_to_install(EXTRA_OF[missing])}"
    if isinstance(error, OSError):
        where = f"{error.filename}: " if error.filename else ""
        return f"{where}{error.strerror or error}"
    return str(error)


def _is_of_extra(error: ModuleNotFoundError) -> bool:
    return "pip install" in str(error) or str(error.name).partition(".")[0] in EXTRA_OF


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let SIGTERM end the block like Ctrl-C; ignore further SIGTERM until the process has ended.

    Ctrl-C raises KeyboardInterrupt again; it ended the process during the imports.
    """

    def end(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise _AskedToEndError

    if (
        threading.current_thread() is not threading.main_thread()
    ):  # only the main thread may set handlers
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    if signal.getsignal(signal.SIGINT) is signal.SIG_DFL:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        yield
    finally:
        if signal.getsignal(signal.SIGTERM) is end:
            signal.signal(signal.SIGTERM, before)


@contextmanager
def progress_bar(what: str, *, unit: str) -> Iterator[_Progress]:
    """Yield a callback (done, total, words) that draws a bar on stderr.

    If that is no terminal, or one of no known width, it prints a line once in
    `SECONDS_BETWEEN_LINES`; shorter work prints nothing.
    """
    if not _count_columns():
        yield _tell_now_and_then(what, unit=unit)
        return
    from tqdm import tqdm  # noqa: TID251 - the command line is where bars belong

    with tqdm(desc=what, unit=unit, file=sys.stderr, leave=False) as bar:

        def report(done: int, total: int, words: str = "") -> None:
            bar.total = total
            bar.set_postfix_str(make_line(words), refresh=False)
            bar.update(done - bar.n)

        yield report


def _count_columns() -> int:
    """Return the columns of the terminal that stderr is; 0 if it is none, or does not say."""
    try:
        return os.get_terminal_size(sys.stderr.fileno()).columns
    except OSError:
        return 0


def _tell_now_and_then(what: str, *, unit: str) -> _Progress:
    last = time.monotonic()
    first: tuple[int, float] | None = None

    def report(done: int, total: int, words: str = "") -> None:
        nonlocal last, first
        now = time.monotonic()
        first = first or (done, now)
        if now - last < SECONDS_BETWEEN_LINES or done >= total:
            return
        last = now
        parts = [f"{what}: {done:,} of {total:,} {unit}s"] + [words] * bool(words)
        if done > first[0]:
            from tqdm import tqdm  # noqa: TID251

            left = (now - first[1]) / (done - first[0]) * (total - done)
            parts.append(f"about {tqdm.format_interval(left)} left")
        print_note(", ".join(parts))

    return report


@contextmanager
def worker_pool(workers: int) -> Iterator[Executor | None]:
    """Yield a pool of processes; None for one worker: do the tasks in this process."""
    if workers == 1:
        yield None
        return
    from concurrent.futures import ProcessPoolExecutor
    from multiprocessing import active_children, get_context

    with (
        importing_nothing_from_here(),
        ProcessPoolExecutor(
            workers, mp_context=get_context("spawn"), initializer=_end_with_parent
        ) as pool,
    ):
        # Only this process handles Ctrl-C. Processes that start while it is ignored here ignore it
        # from their first moment on, so start all of them now.
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        for _ in range(workers):
            pool.submit(os.getpid)
        signal.signal(signal.SIGINT, handler)
        try:
            yield pool
        except KeyboardInterrupt:  # a task may take minutes, and a killed one leaves nothing mixed
            threading.excepthook = lambda _: None  # the pool's thread complains of killed processes
            for process in active_children():
                process.terminate()
            raise


@contextmanager
def importing_nothing_from_here() -> Iterator[None]:
    """Keep new processes from importing modules of the working folder, which may be untrusted.

    `multiprocessing` starts processes with `python -c`, which searches that folder first and would
    run a `random.py` there. Python 3.10 ignores this setting.
    """
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = before or "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]


def _end_with_parent() -> None:
    """End this worker when its parent is killed; otherwise it would wait for ever."""
    from multiprocessing import parent_process

    parent = parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(FAILED)

    threading.Thread(target=wait, daemon=True).start()


def print_json(value: object) -> None:
    """Print one JSON document on stdout; control characters are spelled as `\\u`."""
    text = encode_json(value, indent=1, ensure_ascii=False)
    obeyed = {ord(c): encode_json(c)[1:-1] for c in set(text) if is_obeyed(c)}
    click.echo(text.translate(obeyed))


def print_text(text: str, *, nl: bool = True) -> None:
    """Print a result on stdout, without control characters; see `make_plain`."""
    click.echo(make_plain(text), nl=nl)


def print_note(text: str) -> None:
    """Print a note or an error on stderr: one line without control characters."""
    click.echo(make_line(text), err=True)
