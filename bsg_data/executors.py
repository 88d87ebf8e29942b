"""Run tasks on any `concurrent.futures.Executor`, or one by one without one."""

from __future__ import annotations

from collections.abc import Callable, Collection
from concurrent.futures import BrokenExecutor, Executor
from itertools import starmap
from typing import Any, TypeVar

from bsg_data.errors import BSGError

Result = TypeVar("Result")


def run_all(
    function: Callable[..., Result],
    tasks: Collection[tuple[Any, ...]],
    *,
    executor: Executor | None = None,
    progress: Callable[[int, int], None] | None = None,
) -> list[Result]:
    """Call `function` on every task and return the results in the order of the tasks.

    An error ends it, and cancels what has not begun.

    Args:
        function: called with the elements of a task; importable by name for process pools.
        tasks: arguments of each call.
        executor: runs the tasks in parallel; None runs them one by one in this process.
        progress: called with (tasks done, tasks in all) after each task, in their order.
    """
    made = (
        starmap(function, tasks)
        if executor is None
        else executor.map(function, *zip(*tasks, strict=True))
    )
    results = []
    try:
        for result in made:
            results.append(result)
            if progress is not None:
                progress(len(results), len(tasks))
    except BrokenExecutor as error:
        raise BSGError(
            "a worker process died (killed, or out of memory?); fewer --workers need less memory"
        ) from error
    return results
