"""Commands whose work is done by a real scheduler and two worker processes on loopback."""

from __future__ import annotations

import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import click
import pytest
from click.testing import CliRunner, Result

from bsg_cli import cluster as cluster_module
from bsg_cli import search
from bsg_cli.cluster import connect
from bsg_cli.data import main as data
from bsg_data.build import build_dataset
from bsg_data.errors import BSGError
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import GeometryOptions, write_synthetic

distributed = pytest.importorskip("distributed", reason="the extra `cluster` is not installed")


def run_command(command: click.Command, *words: object, code: int = 0) -> Result:
    result = CliRunner().invoke(command, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result


def all_bytes(folder: Path) -> dict[str, bytes]:
    return {
        path.relative_to(folder).as_posix(): path.read_bytes()
        for path in sorted(folder.rglob("*"))
        if path.is_file()
    }


@pytest.fixture(scope="module")
def scheduler() -> Iterator[str]:
    """The address of a scheduler with two worker processes."""
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
    ) as cluster:
        yield cluster.scheduler_address


@pytest.mark.heavy
def test_a_worker_that_is_killed_costs_time_and_nothing_else(
    scheduler: str, tmp_path: Path
) -> None:
    """A build with meshes, a worker of which dies when the first shard is done."""
    places = tmp_path / "places"
    list(write_synthetic(places, scenes=3, seed=1, geometry=GeometryOptions()))
    build_dataset(HM3DFolder(places), tmp_path / "one", scenes_per_shard=1)
    killed = []

    def kill(done: int, total: int) -> None:
        if done == 1:
            with distributed.Client(scheduler, set_as_default=False) as client:
                killed.append(sorted(client.run(os.getpid).values())[0])
            os.kill(killed[0], signal.SIGKILL)

    with connect(scheduler, reads=[places], writes=[tmp_path / "many"]) as executor:
        build_dataset(
            HM3DFolder(places),
            tmp_path / "many",
            scenes_per_shard=1,
            executor=executor,
            progress=kill,
        )
    assert killed
    assert all_bytes(tmp_path / "many") == all_bytes(tmp_path / "one")


@pytest.mark.heavy
def test_build_and_pairs_from_a_relative_path(
    scheduler: str, hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)  # where no worker stands
    for out, where in (("one", ("--workers", 1)), ("many", ("--scheduler", scheduler))):
        run_command(data, "build", "--hm3d", hm3d_folder.name, "--out", out, *where)
        run_command(data, "split", out)
        run_command(data, "pairs", out, "--draws", 2, *where)
    assert all_bytes(tmp_path / "many") == all_bytes(tmp_path / "one")


@pytest.mark.heavy
def test_a_search_study(scheduler: str, dataset: Path, run: Path, tmp_path: Path) -> None:
    words = ("--model", run, "--data", dataset, "--episodes", 3, "--masks", 1, "--resamples", 5)
    words += ("--worlds", "star", "--planners", "nearest,greedy-belief", "--task", "single")
    found = []
    for out, where in (("one", ("--workers", 1)), ("many", ("--scheduler", scheduler))):
        result = run_command(search.main, *words, "--out", tmp_path / out, *where)
        found.append((result.stdout.rpartition("all results")[0], all_bytes(tmp_path / out)))
    assert found[0] == found[1]


@pytest.mark.heavy
def test_workers_that_lack_the_files_are_refused(scheduler: str, tmp_path: Path) -> None:
    with (
        pytest.raises(BSGError, match="has nothing at"),
        connect(scheduler, reads=[tmp_path / "x"]),
    ):
        pass


@pytest.mark.heavy
def test_a_worker_of_many_threads_is_refused() -> None:
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=":0"
        ) as cluster,
        pytest.raises(BSGError, match=r"does 2 tasks at once in one process.*--nthreads 1"),
        connect(cluster.scheduler_address),
    ):
        pass


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (
            ("--scheduler", "127.0.0.1:9", "--workers", 2),
            "--workers and --scheduler exclude each other",
        ),
        (("--scheduler", "127.0.0.1:9"), "no Dask scheduler answers there"),
    ],
)
def test_wrong_schedulers(
    dataset: Path, words: tuple[str, ...], message: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(cluster_module, "SECONDS_TO_CONNECT", 0.2)
    result = CliRunner().invoke(data, ["pairs", str(dataset), "--force", *map(str, words)])
    assert result.exit_code in (1, 2)
    assert message in result.stderr


def test_without_dask_the_extra_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "distributed", None)
    with (
        pytest.raises(BSGError, match=r"pip install '\./belief-scene-graphs\[cluster\]'"),
        connect("127.0.0.1:9"),
    ):
        pass
