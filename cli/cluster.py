"""Connect to a Dask cluster and check its workers before they get tasks.

Tasks name files by path, so all machines must see the same files at the same paths.
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

from bsg_data.errors import BSGError, ask_to_install
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.inputs.bounds import MANIFEST_FILE, RUN_RECORD
from bsg_data.inputs.documents import read_json

if TYPE_CHECKING:
    from distributed import Client

SECONDS_TO_CONNECT = 30.0
SECONDS_TO_WAIT = 600  # for the first worker; a batch system may start it late
_SECONDS_BETWEEN_LOOKS = 0.5
_PACKAGES = ("belief-scene-graphs", "numpy", "pyarrow")  # their versions decide the bytes written


@contextmanager
def connect(
    address: str, *, reads: Sequence[Path] = (), writes: Sequence[Path] = ()
) -> Iterator[Executor]:
    """Yield the workers of a Dask scheduler as an executor.

    If a worker is lost, another worker repeats its task, as often as the scheduler allows. After
    an error this waits for the running tasks, so that no task writes after the command ended.

    Args:
        address: `host:port` of the scheduler, or the path of its `--scheduler-file`.
        reads: files and folders that tasks read.
        writes: files and folders that tasks write; they need not exist yet.

    Raises:
        BSGError: if `distributed`, the scheduler or a suitable worker is missing, if a task loses
            too many workers, or if the scheduler is lost.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise BSGError(f"--scheduler needs Dask: {ask_to_install('cluster')}") from error
    place = {"scheduler_file": address} if Path(address).is_file() else {"address": address}
    try:
        # Try a bare connection first: a client without a scheduler takes a minute to close.
        asyncio.run(_reach(_read_address(address)))
        client = Client(**place, timeout=SECONDS_TO_CONNECT, set_as_default=False)
    except (OSError, ValueError, KeyError) as error:
        raise BSGError(
            f"--scheduler {address}: no Dask scheduler answers there ({error}); start one with "
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
                f"{error.last_worker.address} (killed, or out of memory?); read its log or the "
                f"scheduler's dashboard, {client.dashboard_link}. Finished work is kept: run the "
                "same command again to continue"
            ) from error
        except CancelledError as error:
            raise BSGError(
                f"--scheduler {address}: the scheduler is lost with its tasks; read its log. "
                "Finished work is kept: run the same command again to continue"
            ) from error
        except BaseException:
            with suppress(OSError, TimeoutError):
                _wait_for_tasks(client)
            raise


def _read_address(address: str) -> str:
    """Return an address, or the address in a scheduler file."""
    path = Path(address)
    if not path.is_file():
        return address
    try:
        return str(read_json(path, RUN_RECORD, error=BSGError)["address"])
    except (KeyError, TypeError) as error:
        raise BSGError(
            f"{path}: no file of a scheduler: expected JSON with an address, as "
            "`dask scheduler --scheduler-file` writes"
        ) from error


async def _reach(address: str) -> None:
    """Connect to a scheduler and close the connection.

    Raises:
        OSError: if no scheduler answers.
        ValueError: if the address is invalid.
    """
    from distributed.comm import connect as reach
    from distributed.core import coerce_to_address
    from distributed.security import Security

    options = Security().get_connection_args("client")
    comm = await reach(coerce_to_address(address), timeout=SECONDS_TO_CONNECT, **options)
    await comm.close()


def _wait_for_worker(client: Client, address: str) -> None:
    """Wait for the first worker.

    Raises:
        BSGError: if no worker connects in `SECONDS_TO_WAIT`.
    """
    if not client.nthreads():
        note = f"waiting for a worker at {address}, for at most {SECONDS_TO_WAIT} s"
        click.echo(note, err=True)
    try:
        client.wait_for_workers(1, timeout=SECONDS_TO_WAIT)
    except TimeoutError as error:
        raise BSGError(
            f"--scheduler {address}: has no worker after {SECONDS_TO_WAIT} s; start some with "
            f"`dask worker {address} --nthreads 1`"
        ) from error


def look(paths: Sequence[str]) -> tuple[str, list[str]]:
    """Return the package versions of a machine, and a description of what is at each path."""
    return ", ".join(f"{name} {version(name)}" for name in _PACKAGES), [
        _describe(Path(path)) for path in paths
    ]


def _describe(path: Path) -> str:
    """Describe what is at a path; machines that see the same files give the same words."""
    if path.is_file():
        return f"a file of {path.stat().st_size:,} bytes"
    if not path.is_dir():
        return "nothing"
    manifest = path / "dataset.json"
    if manifest.is_file():
        try:
            return f"the dataset {hash_file(manifest, MANIFEST_FILE)[:12]}…"
        except OSError as error:
            return f"a dataset that cannot be read ({error.strerror or error})"
    return f"a folder of {sum(1 for _ in path.iterdir()):,} things"


def _require_alike(client: Client, *, reads: Sequence[Path], writes: Sequence[Path]) -> None:
    """Refuse workers with other versions, several threads, or other files than this process.

    Raises:
        BSGError: for the first such worker; it says the difference.
    """
    for worker, threads in client.nthreads().items():
        if threads != 1:
            raise BSGError(
                f"worker {worker}: does {threads} tasks at once in one process; expected 1, for "
                "tasks of one process share the random state; start workers with "
                "`dask worker ADDRESS --nthreads 1 --nworkers N`"
            )
    with _marks(writes) as marks:
        paths = [str(path.absolute()) for path in (*reads, *marks)]
        own_version, own = look(paths)
        for worker, found in client.run(look, paths, on_error="return").items():
            if isinstance(found, BaseException):
                raise BSGError(
                    f"worker {worker}: cannot run this package ({found!r}); install it there"
                )
            if found[0] != own_version:
                raise BSGError(
                    f"worker {worker}: has {found[0]}; expected {own_version}, as on this machine; "
                    "install the same versions there"
                )
            for path, here, there in zip(paths, own, found[1], strict=True):
                if here != there:
                    raise BSGError(
                        f"worker {worker}: sees {there} at {path}; this machine sees {here} there; "
                        "give all machines one file system at the same path"
                    )


@contextmanager
def _marks(writes: Sequence[Path]) -> Iterator[list[Path]]:
    """Yield new files in the folders that tasks write to; workers must see these files."""
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
    """Wait for all tasks that run now; a cancelled task still runs to its end."""
    begun = _list_active(client)
    while begun & _list_active(client):
        time.sleep(_SECONDS_BETWEEN_LOOKS)


def _list_active(client: Client) -> set[str]:
    return {key for keys in client.run(_list_own_active).values() for key in keys}


def _list_own_active(dask_worker: Any) -> list[str]:
    return [str(key) for key in dask_worker.active_threads.values()]
