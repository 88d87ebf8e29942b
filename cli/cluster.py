"""Workers of other machines: Dask's executor, and what is asked of its workers before any task.

Tasks name files by their paths, so all machines must see the same files at the same paths.
"""

from __future__ import annotations

import asyncio
import os
import tempfile
import time
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager, suppress
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from bsg_data.errors import BSGError
from bsg_data.inputs.bounded_file import hash_bounded
from bsg_data.inputs.bounds import MANIFEST_FILE, RUN_RECORD
from bsg_data.inputs.documents import read_json

if TYPE_CHECKING:
    from distributed import Client

SECONDS_TO_CONNECT = 30.0
SECONDS_TO_WAIT = 600  # for the first worker, which a batch system may start late
_SECONDS_BETWEEN_LOOKS = 0.5
_PACKAGES = ("belief-scene-graphs", "numpy", "pyarrow")  # whose versions bytes depend on


@contextmanager
def connect(
    address: str, *, reads: Sequence[Path] = (), writes: Sequence[Path] = ()
) -> Iterator[Executor]:
    """Yield the workers of a Dask scheduler as an executor.

    A task whose worker is lost is done again by another one, as often as the scheduler allows. On
    an error the tasks under way are waited for, as a pool of processes does, so that none writes
    when the command has ended.

    Args:
        address: `host:port` of the scheduler, or the path of its `--scheduler-file`.
        reads: files and folders that tasks read.
        writes: files and folders that tasks write, which need not exist yet.

    Raises:
        BSGError: without `distributed`, a scheduler or a worker that can do the work; if a task
            loses too many workers, or the scheduler is lost.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise BSGError(
            "--scheduler needs Dask: pip install 'belief-scene-graphs[cluster]'"
        ) from error
    place = {"scheduler_file": address} if Path(address).is_file() else {"address": address}
    try:
        # First a bare connection: a client that finds nobody takes another minute to be closed.
        asyncio.run(_reach(_read_address(address)))
        client = Client(**place, timeout=SECONDS_TO_CONNECT, set_as_default=False)
    except (OSError, ValueError, KeyError) as error:
        raise BSGError(
            f"--scheduler {address}: no Dask scheduler answers there ({error}); start one by "
            "`dask scheduler`, which prints its address"
        ) from error
    with client:
        _wait_for_worker(client, address)
        _require_alike(client, reads=reads, writes=writes)
        try:
            yield client.get_executor()
        except KilledWorker as error:
            raise BSGError(
                f"{error.allowed_failures + 1} workers died on one task, the last one "
                f"{error.last_worker.address} (killed, or out of memory?); its log says more, and "
                f"so does the scheduler's dashboard, {client.dashboard_link}. What is done is "
                "kept: the same command goes on"
            ) from error
        except CancelledError as error:
            raise BSGError(
                f"--scheduler {address}: is lost with the tasks that it had; its log says why. "
                "The same command goes on from what is done"
            ) from error
        except BaseException:
            with suppress(OSError, TimeoutError):
                _wait_for_tasks(client)
            raise


def _read_address(address: str) -> str:
    """Return an address, also from the file of a scheduler."""
    path = Path(address)
    if not path.is_file():
        return address
    try:
        return str(read_json(path, RUN_RECORD, error=BSGError)["address"])
    except (KeyError, TypeError) as error:
        raise BSGError(f"{path}: no file of a scheduler, which has an address") from error


async def _reach(address: str) -> None:
    """Connect to a scheduler, and let go.

    Raises:
        OSError: if nobody answers.
        ValueError: for what is no address.
    """
    from distributed.comm import connect as reach
    from distributed.core import coerce_to_address
    from distributed.security import Security

    options = Security().get_connection_args("client")
    comm = await reach(coerce_to_address(address), timeout=SECONDS_TO_CONNECT, **options)
    await comm.close()


def _wait_for_worker(client: Client, address: str) -> None:
    """Wait until there is a worker.

    Raises:
        BSGError: if none comes.
    """
    if not client.nthreads():
        note = f"waiting for a worker at {address}, {SECONDS_TO_WAIT} s at most"
        click.echo(note, err=True)
    try:
        client.wait_for_workers(1, timeout=SECONDS_TO_WAIT)
    except TimeoutError as error:
        raise BSGError(
            f"--scheduler {address}: has no worker after {SECONDS_TO_WAIT} s; start some by "
            f"`dask worker {address} --nthreads 1`"
        ) from error


def look(paths: Sequence[str]) -> tuple[str, list[str]]:
    """Return versions on a machine that bytes depend on, and what is there at some paths."""
    return ", ".join(f"{name} {version(name)}" for name in _PACKAGES), [
        _describe(Path(path)) for path in paths
    ]


def _describe(path: Path) -> str:
    """Say in words what is at a path, so that two machines that see the same say the same."""
    if path.is_file():
        return f"a file of {path.stat().st_size:,} bytes"
    if not path.is_dir():
        return "nothing"
    manifest = path / "dataset.json"
    if manifest.is_file():
        try:
            return f"the dataset {hash_bounded(manifest, MANIFEST_FILE)[:12]}…"
        except OSError as error:
            return f"a dataset that cannot be read ({error.strerror or error})"
    return f"a folder of {sum(1 for _ in path.iterdir()):,} things"


def _require_alike(client: Client, *, reads: Sequence[Path], writes: Sequence[Path]) -> None:
    """Refuse workers that are not like this process, or do not see what it sees.

    Raises:
        BSGError: for the first, saying how it differs.
    """
    for worker, threads in client.nthreads().items():
        if threads != 1:
            raise BSGError(
                f"worker {worker}: does {threads} tasks at once in one process, which share one "
                "state of chance; start workers by `dask worker ADDRESS --nthreads 1 --nworkers N`"
            )
    with _marks(writes) as marks:
        paths = [str(path.absolute()) for path in (*reads, *marks)]
        own_version, own = look(paths)
        for worker, found in client.run(look, paths, on_error="return").items():
            if isinstance(found, BaseException):
                raise BSGError(f"worker {worker}: cannot run this package ({found!r}); install it")
            if found[0] != own_version:
                raise BSGError(f"worker {worker}: has {found[0]}; here is {own_version}")
            for path, here, there in zip(paths, own, found[1], strict=True):
                if here != there:
                    raise BSGError(
                        f"worker {worker}: sees {there} at {path}, and here it is {here}; all "
                        "machines need one file system, at the same path"
                    )


@contextmanager
def _marks(writes: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield new files in the folders that are written into, by which a worker knows them again."""
    marks: list[Path] = []
    try:
        for path in writes:
            folder = next(above for above in path.absolute().parents if above.is_dir())
            handle, name = tempfile.mkstemp(prefix=".bsg-", dir=folder)
            os.close(handle)
            marks.append(Path(name))
        yield marks
    finally:
        for mark in marks:
            mark.unlink()


def _wait_for_tasks(client: Client) -> None:
    """Wait until the tasks that workers are at now have ended; who is cancelled still goes on."""
    begun = _list_active(client)
    while begun & _list_active(client):
        time.sleep(_SECONDS_BETWEEN_LOOKS)


def _list_active(client: Client) -> set[str]:
    return {key for keys in client.run(_list_own_active).values() for key in keys}


def _list_own_active(dask_worker: Any) -> list[str]:
    return [str(key) for key in dask_worker.active_threads.values()]
