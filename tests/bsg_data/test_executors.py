"""Any number of tasks goes through any executor."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from functools import partial
from pathlib import Path
from time import sleep

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.build import build_dataset
from bsg_data.errors import BSGError
from bsg_data.executors import run_all
from bsg_data.sources.hm3d import HM3DFolder


@given(numbers=st.lists(st.integers(), max_size=20))
def test_results_are_those_of_calls_one_after_another(numbers: list[int]) -> None:
    tasks = [(number, 2) for number in numbers]
    expected = [number * 2 for number in numbers]
    with ThreadPoolExecutor(3) as pool:
        for executor in (None, pool):
            done: list[int] = []
            note = partial(_note, done)
            assert run_all(int.__mul__, tasks, executor=executor, progress=note) == expected
            assert done == [number + 1 for number in range(len(tasks))]


def _note(done: list[int], number: int, of: int) -> None:
    done.append(number)


def test_a_dead_worker_is_told_in_words() -> None:
    def die(_: int) -> int:
        raise BrokenProcessPool("it is gone")

    with ThreadPoolExecutor(1) as pool, pytest.raises(BSGError, match="a worker process died"):
        run_all(die, [(1,)], executor=pool)


@pytest.mark.heavy
def test_a_cluster_of_dask_builds_the_same_bytes(hm3d_folder: Path, tmp_path: Path) -> None:
    """As docs/scaling.md says: two worker processes on loopback, one task at a time each."""
    distributed = pytest.importorskip("distributed", reason="the extra `cluster` is not installed")
    build_dataset(HM3DFolder(hm3d_folder), tmp_path / "one", scenes_per_shard=4)
    with (
        distributed.LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, dashboard_address=":0"
        ) as cluster,
        distributed.Client(cluster, set_as_default=False) as client,
    ):
        build_dataset(
            HM3DFolder(hm3d_folder),
            tmp_path / "many",
            scenes_per_shard=4,
            executor=client.get_executor(),
        )
    for path in (tmp_path / "one").rglob("*.*"):
        copy = tmp_path / "many" / path.relative_to(tmp_path / "one")
        assert copy.read_bytes() == path.read_bytes(), path.name


def test_a_fault_ends_it_and_cancels_what_has_not_begun() -> None:
    begun: list[int] = []

    def work(number: int) -> int:
        begun.append(number)
        if number == 2:
            raise ValueError("two")
        sleep(0.001)
        return number

    with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="two"):
        run_all(work, [(n,) for n in range(10_000)], executor=pool)
    assert len(begun) < 1_000
