"""Run tasks on any `concurrent.futures.Executor`, or one by one without one."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from contextlib import contextmanager
from itertools import islice
from typing import Any, TypeVar

from bsg_data.errors import BSGError

Result = TypeVar("Result")
WINDOW = 512  # largest number of tasks submitted and not done; bounds workers and memory


def run_all(
    function: Callable[..., Result],
    tasks: Collection[tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Call `function` on every task and return the results in the order of the tasks.

    At most `WINDOW` tasks are submitted and not done.

    Args:
        function: called with the elements of a task; importable by name for process pools.
        tasks: arguments of each call.
        executor: runs the tasks in parallel; None runs them one by one in this process.
        progress: called with (tasks done, tasks in all) after each task.
    """
    report = progress or (lambda done, total: None)
    results: dict[int, Result] = {}
    for number, result in _run(function, tasks, executor):
        results[number] = result
        report(len(results), len(tasks))
    return [results[number] for number in range(len(results))]


def run_in_order(
    function: Callable[..., Result],
    tasks: Iterable[tuple[Any, ...]],
    *,
    executor: Executor | None = None,
) -> Iterator[Result]:
    """Yield the results of any number of tasks in order, with at most `WINDOW` in memory."""
    if executor is None:
        yield from (function(*task) for task in tasks)
        return
    waiting: deque[Future[Result]] = deque()
    with _cancelled_when_left(waiting):
        for task in tasks:
            if len(waiting) == WINDOW:
                yield waiting.popleft().result()
            waiting.append(executor.submit(function, *task))
        while waiting:
            yield waiting.popleft().result()


def _run(
    function: Callable[..., Result],
    tasks: Iterable[tuple[Any, ...]],
    executor: Executor | None,
) -> Iterator[tuple[int, Result]]:
    """Yield number and result of every task as soon as it is done."""
    numbered = enumerate(tasks)
    if executor is None:
        yield from ((number, function(*task)) for number, task in numbered)
        return
    waiting: dict[Future[Result], int] = {}
    with _cancelled_when_left(waiting):
        while True:
            for number, task in islice(numbered, WINDOW - len(waiting)):
                waiting[executor.submit(function, *task)] = number
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                yield waiting.pop(future), future.result()


@contextmanager
def _cancelled_when_left(waiting: Collection[Future[Any]]) -> Iterator[None]:
    """Cancel waiting tasks when the block ends, and explain the death of a worker."""
    try:
        yield
    except BrokenExecutor as error:
        raise BSGError(
            "a worker process died (killed, or out of memory?); fewer --workers need less memory"
        ) from error
    finally:
        for future in waiting:
            future.cancel()
