"""Run tasks on any `concurrent.futures.Executor`, or one by one without one."""

from __future__ import annotations

from collections.abc import Callable, Collection
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from itertools import islice
from typing import Any, TypeVar

from bsg_data.errors import BSGError

Result = TypeVar("Result")
WINDOW = 512  # largest number of tasks that are begun and not done


def run_all(
    function: Callable[..., Result],
    tasks: Collection[tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Call `function` on every task and return the results in the order of the tasks.

    Args:
        function: called with the elements of a task; importable by name for process pools.
        tasks: arguments of each call.
        executor: runs the tasks in parallel; None runs them one by one in this process.
        progress: called with (tasks done, tasks in all) after each task.
    """
    results: dict[int, Result] = {}
    waiting: dict[Future[Result], int] = {}
    numbered = enumerate(tasks)

    def keep(number: int, result: Result) -> None:
        results[number] = result
        if progress is not None:
            progress(len(results), len(tasks))

    try:
        for number, task in numbered if executor is None else ():
            keep(number, function(*task))
        while executor is not None and len(results) < len(tasks):
            for number, task in islice(numbered, WINDOW - len(waiting)):
                waiting[executor.submit(function, *task)] = number
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                keep(waiting.pop(future), future.result())
    except BrokenExecutor as error:
        raise BSGError(
            "a worker process died (killed, or out of memory?); fewer --workers need less memory"
        ) from error
    finally:
        for future in waiting:
            future.cancel()
    return [results[number] for number in range(len(tasks))]
