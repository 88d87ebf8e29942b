"""Connect to a Dask cluster and check its workers before they get tasks.

Tasks name files by path, so all machines must see the same files at the same paths.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Iterator, Sequence
from concurrent.futures import CancelledError, Executor
from contextlib import contextmanager
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING

import click

from bsg_data.errors import BSGError, ask_to_install

if TYPE_CHECKING:
    from distributed import Client

SECONDS_TO_CONNECT = 30.0
SECONDS_TO_WAIT = 600  # for the first worker; a batch system may start it late
_PACKAGES = ("belief-scene-graphs", "numpy", "pyarrow")  # their versions decide the bytes written


@contextmanager
def connect(
    address: str, *, reads: Sequence[Path] = (), writes: Sequence[Path] = ()
) -> Iterator[Executor]:
    """Yield the workers of a Dask scheduler as an executor.

    If a worker is lost, another worker repeats its task, as often as the scheduler allows.

    Args:
        address: `host:port` of the scheduler, or the path of its `--scheduler-file`.
        reads: files and folders that tasks read.
        writes: files and folders that tasks write; they need not exist yet.
    """
    try:
        from distributed import Client, KilledWorker
    except ImportError as error:
        raise BSGError(f"--scheduler needs Dask: {ask_to_install('cluster')}") from error
    try:
        if Path(address).is_file():
            address = str(json.loads(Path(address).read_text("utf-8"))["address"])
        # Try a bare connection first: a client without a scheduler takes a minute to close.
        asyncio.run(_reach(address))
        client = Client(address, timeout=SECONDS_TO_CONNECT, set_as_default=False)
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise BSGError(
            f"--scheduler {address}: no Dask scheduler answers there ({error}); start one with "
            "`dask scheduler`, which prints its address"
        ) from error
    with client:
        _wait_for_worker(client, address)
        _require_alike(client, [path.absolute() for path in reads], writes)
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


async def _reach(address: str) -> None:
    """Connect to a scheduler and close the connection."""
    from distributed.comm import connect as reach
    from distributed.core import coerce_to_address
    from distributed.security import Security

    options = Security().get_connection_args("client")
    comm = await reach(coerce_to_address(address), timeout=SECONDS_TO_CONNECT, **options)
    await comm.close()


def _wait_for_worker(client: Client, address: str) -> None:
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


def look(paths: Sequence[Path]) -> tuple[str, list[Path]]:
    """Return the package versions of a machine, and which of some paths it lacks."""
    versions = ", ".join(f"{name} {version(name)}" for name in _PACKAGES)
    return versions, [path for path in paths if not path.exists()]


def _require_alike(client: Client, reads: Sequence[Path], writes: Sequence[Path]) -> None:
    """Refuse workers with other versions, several threads, or without the files."""
    above = [path.absolute().parent for path in writes]
    own, _ = look(())
    told = client.run(look, [*reads, *above], on_error="return")
    for worker, threads in client.nthreads().items():
        if threads != 1:
            raise BSGError(
                f"worker {worker}: does {threads} tasks at once in one process; expected 1, for "
                "tasks of one process share the random state; start workers with "
                "`dask worker ADDRESS --nthreads 1 --nworkers N`"
            )
        if isinstance(told[worker], BaseException):
            raise BSGError(
                f"worker {worker}: cannot run this package ({told[worker]!r}); install it there"
            )
        versions, missing = told[worker]
        if versions != own:
            raise BSGError(
                f"worker {worker}: has {versions}; expected {own}, as on this machine; install the "
                "same versions there"
            )
        if missing:
            raise BSGError(
                f"worker {worker}: has nothing at {missing[0]}; give all machines one file system "
                "at the same path"
            )
