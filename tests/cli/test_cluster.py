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
from bsg_data.executors import run_all
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.synthetic.geometry import GeometryOptions
from bsg_models.studies.leaderboard import make_leaderboard
from bsg_models.studies.leaderboard_runs import LeaderboardRecipe
from bsg_models.zoo.config import find_config

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
def test_a_leaderboard(scheduler: str, dataset: Path, tmp_path: Path) -> None:
    models = {name: find_config(name) for name in ("doubled", "gamma-poisson")}
    recipe = LeaderboardRecipe(masks=("rooms",), folds=3, draws=1, resamples=2)
    one = make_leaderboard(dataset, tmp_path / "one", models, recipe)
    with connect(scheduler, writes=[tmp_path / "many"]) as executor:
        many = make_leaderboard(dataset, tmp_path / "many", models, recipe, executor=executor)
    for name in models:  # as text, in which a metric that is not defined is itself
        metrics = [str(board.results["rooms"][name].metrics.point) for board in (one, many)]
        assert metrics[0] == metrics[1]
    timed = ("log.jsonl", "SHA256SUMS")  # which lists the log
    found = [
        {path: data for path, data in all_bytes(tmp_path / out).items() if not path.endswith(timed)}
        for out in ("one", "many")
    ]
    assert found[0] == found[1]


@pytest.mark.heavy
def test_a_search_study(scheduler: str, dataset: Path, run: Path, tmp_path: Path) -> None:
    words = ("--model", run, "--data", dataset, "--episodes", 3, "--masks", 1, "--resamples", 5)
    words += ("--worlds", "star", "--planners", "nearest,greedy-belief", "--task", "single")
    found = []
    for out, where in (("one", ("--workers", 1)), ("many", ("--scheduler", scheduler))):
        result = run_command(search.main, *words, "--out", tmp_path / out, *where)
        found.append((result.stdout.rpartition("all results")[0], all_bytes(tmp_path / out)))
    assert found[0] == found[1]


def fail_or_write(path: Path, fails: bool, begun: Path) -> None:
    """Raise at once, or say that this has begun and write a file a second later."""
    import time

    if fails:
        while not begun.exists():
            time.sleep(0.01)
        raise ValueError("no")
    begun.touch()
    time.sleep(1)
    path.touch()


@pytest.mark.heavy
def test_after_an_error_no_worker_writes_any_more(scheduler: str, tmp_path: Path) -> None:
    paths = (tmp_path / "failed", tmp_path / "written")
    tasks = [(paths[0], True, tmp_path / "begun"), (paths[1], False, tmp_path / "begun")]
    with pytest.raises(ValueError, match="no"), connect(scheduler) as executor:
        run_all(fail_or_write, tasks, executor=executor)
    assert paths[1].exists()


@pytest.mark.heavy
def test_workers_that_see_other_files_are_refused(
    scheduler: str, hm3d_folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What the machine of the command sees is altered: the workers are another one then."""
    monkeypatch.setattr(cluster_module, "_describe", lambda path: "a file of 7 bytes")
    with (
        pytest.raises(BSGError, match=r"worker tcp://.*: sees a folder of 2 things at .*hm3d; "),
        connect(scheduler, reads=[hm3d_folder]),
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
