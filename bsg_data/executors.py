"""Run tasks on any `concurrent.futures.Executor`, or one by one without one."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, Executor, Future, wait
from itertools import count, islice
from typing import Any, TypeVar

from bsg_data.errors import BSGError

Result = TypeVar("Result")
WINDOW = 512  # largest number of tasks begun and not yielded; bounds workers and memory


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
    done = count(1)

    def report() -> None:
        if progress is not None:
            progress(next(done), len(tasks))

    return list(run_in_order(function, tasks, executor=executor, report=report))


def run_in_order(
    function: Callable[..., Result],
    tasks: Iterable[tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    report: Callable[[], None] = lambda: None,
) -> Iterator[Result]:
    """Yield the results of any number of tasks in order, with at most `WINDOW` in memory.

    `report` is called when a task is done. A fault of a task is raised as soon as it is known.
    """
    if executor is None:
        for task in tasks:
            result = function(*task)
            report()
            yield result
        return
    numbered, turn = enumerate(tasks), 0
    waiting: dict[Future[Result], int] = {}
    ready: dict[int, Result] = {}
    try:
        while True:
            for number, task in islice(numbered, WINDOW - len(waiting) - len(ready)):
                waiting[executor.submit(function, *task)] = number
            if not waiting:
                return
            for future in wait(waiting, return_when=FIRST_COMPLETED).done:
                ready[waiting.pop(future)] = future.result()
                report()
            while turn in ready:
                yield ready.pop(turn)
                turn += 1
    except BrokenExecutor as error:
        raise BSGError(
            "a worker process died (killed, or out of memory?); fewer --workers need less memory"
        ) from error
    finally:
        for future in waiting:
            future.cancel()
