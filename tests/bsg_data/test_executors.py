"""Any number of tasks goes through any executor, a window of them at a time."""

from __future__ import annotations

from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from concurrent.futures.process import BrokenProcessPool
from threading import Event
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data import executors
from bsg_data.errors import BSGError
from bsg_data.executors import run_all, run_in_order


class Counting(ThreadPoolExecutor):
    """An executor that knows how many tasks it was handed and has not done, at most."""

    def __init__(self) -> None:
        super().__init__(3)
        self.held: list[Future[Any]] = []
        self.most = 0

    def submit(self, fn: Callable[..., Any], /, *args: Any, **kwargs: Any) -> Future[Any]:
        self.held = [future for future in self.held if not future.done()]
        self.held.append(super().submit(fn, *args, **kwargs))
        self.most = max(self.most, len(self.held))
        return self.held[-1]


@pytest.fixture
def window(monkeypatch: pytest.MonkeyPatch) -> int:
    monkeypatch.setattr(executors, "WINDOW", 5)
    return 5


@given(numbers=st.lists(st.integers(), max_size=20))
def test_results_are_those_of_calls_one_after_another(numbers: list[int]) -> None:
    tasks = [(number, 2) for number in numbers]
    expected = [number * 2 for number in numbers]
    with ThreadPoolExecutor(3) as pool:
        for executor in (None, pool):
            assert run_all(int.__mul__, tasks, executor=executor) == expected
            assert list(run_in_order(int.__mul__, iter(tasks), executor=executor)) == expected


def test_no_more_than_a_window_is_handed_out(window: int) -> None:
    done: list[tuple[int, int]] = []
    tasks = [(number,) for number in range(40)]
    with Counting() as pool:
        results = run_all(abs, tasks, executor=pool, progress=lambda *counts: done.append(counts))
    assert results == list(range(40))
    assert done == [(number, 40) for number in range(1, 41)]
    assert pool.most <= window
    with Counting() as pool:
        assert list(run_in_order(abs, iter(tasks), executor=pool)) == list(range(40))
    assert pool.most <= window


def test_a_slow_task_does_not_hold_up_those_after_it(window: int) -> None:
    """The first task ends when the last has begun, which is many windows later."""
    last = Event()

    def work(number: int) -> int:
        if number == 39:
            last.set()
        if number == 0:
            assert last.wait(timeout=60)
        return number

    with ThreadPoolExecutor(2) as pool:
        assert run_all(work, [(n,) for n in range(40)], executor=pool) == list(range(40))


def test_a_fault_cancels_what_has_not_begun(window: int) -> None:
    begun: list[int] = []

    def work(number: int) -> int:
        begun.append(number)
        if number == 2:
            raise ValueError("two")
        return number

    for run in (run_all, lambda *task, **where: list(run_in_order(*task, **where))):
        begun.clear()
        with ThreadPoolExecutor(1) as pool, pytest.raises(ValueError, match="two"):
            run(work, [(n,) for n in range(1000)], executor=pool)
        assert len(begun) <= 3 + 2 * window


def test_a_dead_worker_is_told_in_words() -> None:
    def die(_: int) -> int:
        raise BrokenProcessPool("it is gone")

    with ThreadPoolExecutor(1) as pool:
        with pytest.raises(BSGError, match="a worker process died"):
            run_all(die, [(1,)], executor=pool)
        with pytest.raises(BSGError, match="a worker process died"):
            list(run_in_order(die, [(1,)], executor=pool))
