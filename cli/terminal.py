"""What all commands share: exit codes, errors, progress bars and the worker pool.

A result goes to stdout, as text or with `--json` as JSON; progress, notes and errors go to stderr.
Exit codes: 0 done, 1 failed or found faults, 2 wrong usage, 130 interrupted, 143 asked to end.
"""

from __future__ import annotations

import os
import signal
import sys
import time
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import contextmanager
from dataclasses import dataclass
from io import TextIOWrapper
from multiprocessing import get_context, parent_process
from pathlib import Path
from threading import Thread, current_thread, main_thread
from types import FrameType
from typing import Any, NoReturn, Protocol

import click
from pydantic import ValidationError
from tqdm import tqdm  # noqa: TID251 -- the command line is where bars belong

from bsg_cli.cluster import connect
from bsg_cli.dataset_paths import require_datasets
from bsg_data.errors import BSGError, RecipeError
from bsg_data.files import encode_json
from bsg_data.recipes import name_fault
from bsg_data.tables import is_obeyed, make_plain

FAILED, WRONG_USAGE, INTERRUPTED, ENDED = 1, 2, 130, 143
NO_MEMORY = "Error: not enough memory; give the command more, or fewer --workers where it has them"
SECONDS_BETWEEN_LINES = 30.0  # of progress, where stderr is no terminal


class AskedToEndError(KeyboardInterrupt):
    """SIGTERM came: what a cluster or a shutdown sends undoes and keeps what Ctrl-C does."""


class Command(click.Command):
    """A command with the manners of the house: its helps, its version, its exit codes."""

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        click.version_option(package_name="belief-scene-graphs")(self)

    def get_help_option_names(self, ctx: click.Context) -> list[str]:
        """Return the two spellings of help, whatever context asks."""
        return ["-h", "--help"]

    def parse_args(self, ctx: click.Context, args: list[str]) -> list[str]:
        """Parse a command line; a missing dataset is refused before its words are judged."""
        require_datasets(self, ctx, args)
        return super().parse_args(ctx, args)

    def main(self, *args: Any, **kwargs: Any) -> NoReturn:
        """Run the command and leave the process with one of the five exit codes.

        What the libraries raise becomes a message.
        """
        for stream in (sys.stdout, sys.stderr):
            if isinstance(stream, TextIOWrapper):  # a terminal may lack a letter of some name
                stream.reconfigure(errors="replace")
        try:
            kwargs["standalone_mode"] = False
            with _ended_in_order():
                code = super().main(*args, **kwargs)
        except click.ClickException as error:
            error.message = make_plain(error.message)  # type: ignore[misc]
            error.show()
            sys.exit(error.exit_code)
        except BSGError as error:
            print_note(f"Error: {error}")
            sys.exit(WRONG_USAGE if isinstance(error, RecipeError) else FAILED)
        except ValidationError as error:  # of a request, which says what it cannot be
            print_note(f"Error: {name_fault(error)}")
            sys.exit(WRONG_USAGE)
        except (click.Abort, KeyboardInterrupt) as error:  # click makes the one of the other
            asked = isinstance(error.__cause__ or error, AskedToEndError)
            print_note("asked to end" if asked else "interrupted")
            sys.exit(ENDED if asked else INTERRUPTED)
        except MemoryError:
            print_note(NO_MEMORY)
            sys.exit(FAILED)
        except OSError as error:
            where = f"{error.filename}: " if error.filename else ""
            print_note(f"Error: {where}{error.strerror or error}{_hint_at(error)}")
            sys.exit(FAILED)
        sys.exit(code if isinstance(code, int) else 0)


def _hint_at(error: OSError) -> str:
    """Return what to do about an error whose words do not say it."""
    lacks_folder = "temporary directory" in (error.strerror or "")  # Python's, of `tempfile`
    return "; set TMPDIR to a folder that can be written" if lacks_folder else ""


class CommandGroup(Command, click.Group):
    """A group of such commands."""

    command_class = Command


@contextmanager
def _ended_in_order() -> Iterator[None]:
    """Let SIGTERM end the block as Ctrl-C does; one that comes while that is done is ignored."""

    def end(number: int, frame: FrameType | None) -> None:
        signal.signal(signal.SIGTERM, signal.SIG_IGN)
        raise AskedToEndError

    if current_thread() is not main_thread():  # no other may say what a signal does
        yield
        return
    before = signal.signal(signal.SIGTERM, end)
    try:
        yield
    finally:
        signal.signal(signal.SIGTERM, before)


class Progress(Protocol):
    """What is told how far some work is: units done, units in all, and a word about it."""

    def __call__(self, done: int, total: int, said: str = "") -> None:
        """Take it in."""


@contextmanager
def progress_bar(what: str, *, unit: str) -> Iterator[Progress]:
    """Yield what draws a bar on stderr; where that is no terminal, it says a line now and then."""
    if not sys.stderr.isatty():
        yield tell_now_and_then(what, unit=unit)
        return
    with tqdm(desc=what, unit=unit, file=sys.stderr, leave=False) as bar:

        def report(done: int, total: int, said: str = "") -> None:
            bar.total = total
            bar.set_postfix_str(make_plain(said), refresh=False)
            bar.update(done - bar.n)

        yield report


def tell_now_and_then(
    what: str, *, unit: str, clock: Callable[[], float] = time.monotonic
) -> Progress:
    """Return what says on stderr how far some work is, once in `SECONDS_BETWEEN_LINES`.

    Work that takes less says nothing.
    """
    told = clock()
    first: tuple[int, float] | None = None

    def report(done: int, total: int, said: str = "") -> None:
        nonlocal told, first
        now = clock()
        first = first or (done, now)
        if now - told < SECONDS_BETWEEN_LINES or done >= total:
            return
        told = now
        words = [f"{what}: {done:,} of {total:,} {unit}s"] + [said] * bool(said)
        if done > first[0]:
            left = (now - first[1]) / (done - first[0]) * (total - done)
            words.append(f"about {tqdm.format_interval(left)} left")
        print_note(", ".join(words))

    return report


@dataclass(frozen=True, slots=True)
class Workers:
    """Who does the parallel part of a command.

    Attributes:
        processes: of this machine.
        scheduler: address of Dask's, whose workers take their place.
    """

    processes: int
    scheduler: str | None = None


@contextmanager
def worker_pool(
    workers: Workers, *, reads: Sequence[Path] = (), writes: Sequence[Path] = ()
) -> Iterator[Executor | None]:
    """Yield what does tasks: a pool of processes, a cluster, or None for one worker: do them here.

    Args:
        workers: processes, or a scheduler.
        reads: files and folders that tasks read; the workers of a cluster must see the same.
        writes: files and folders that tasks write.
    """
    if workers.scheduler is not None:
        with connect(workers.scheduler, reads=reads, writes=writes) as cluster:
            yield cluster
        return
    if workers.processes == 1:
        yield None
        return
    with (
        _importing_nothing_from_here(),
        ProcessPoolExecutor(
            workers.processes, mp_context=get_context("spawn"), initializer=end_with_parent
        ) as pool,
    ):
        # Ctrl-C is for this process alone. What is ignored here stays ignored in a process that
        # starts now, from its first moment on; so start them all now.
        handler = signal.signal(signal.SIGINT, signal.SIG_IGN)
        for _ in range(workers.processes):
            pool.submit(os.getpid)
        signal.signal(signal.SIGINT, handler)
        yield pool


@contextmanager
def _importing_nothing_from_here() -> Iterator[None]:
    """Let processes that start look for no module in the working folder, which may be a stranger's.

    Python puts that folder first for `python -c`, by which `multiprocessing` starts its processes:
    a file `random.py` there would be run. It knows this setting from 3.11 on.
    """
    before = os.environ.get("PYTHONSAFEPATH")
    os.environ["PYTHONSAFEPATH"] = before or "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ["PYTHONSAFEPATH"]


def end_with_parent() -> None:
    """Let this worker end when its parent is killed, which otherwise leaves it waiting for ever."""
    parent = parent_process()
    if parent is None:
        return

    def wait() -> None:
        parent.join()
        os._exit(FAILED)

    Thread(target=wait, daemon=True).start()


def print_json(value: object) -> None:
    """Print one JSON document on stdout; what a terminal would obey in it is spelled as `\\u`."""
    text = encode_json(value, indent=1, ensure_ascii=False)
    obeyed = {ord(c): encode_json(c)[1:-1] for c in set(text) if is_obeyed(c)}
    click.echo(text.translate(obeyed))


def print_text(text: str, *, nl: bool = True) -> None:
    """Print a result on stdout, without what a terminal would obey; see `make_plain`."""
    click.echo(make_plain(text), nl=nl)


def print_note(text: str) -> None:
    """Tell people something on stderr."""
    click.echo(make_plain(text), err=True)
