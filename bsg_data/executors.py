"""The one seam for parallel work: any `concurrent.futures.Executor`, or none."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from concurrent.futures import BrokenExecutor, Executor, as_completed
from typing import Any, TypeVar

from bsg_data.errors import BSGError

Result = TypeVar("Result")


def run_all(
    function: Callable[..., Result],
    tasks: Sequence[tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Call `function` on every task and return the results in the order of the tasks.

    Args:
        function: of the elements of a task; importable by name, if `executor` uses processes.
        tasks: arguments.
        executor: where to call it; None calls it here, one after another.
        progress: called with (tasks done, tasks in all) as each is done.

    Raises:
        Exception: the first that a task raises; tasks not begun by then are cancelled.
    """
    report = progress or (lambda done, total: None)
    if executor is None:
        results = []
        for done, task in enumerate(tasks, start=1):
            results.append(function(*task))
            report(done, len(tasks))
        return results
    futures = [executor.submit(function, *task) for task in tasks]
    try:
        for done, future in enumerate(as_completed(futures), start=1):
            future.result()
            report(done, len(tasks))
    except BrokenExecutor as error:
        raise BSGError(
            "a worker process died (killed, or out of memory?); fewer --workers need less memory"
        ) from error
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return [future.result() for future in futures]
