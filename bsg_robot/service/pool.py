"""Processes that answer, one question each at a time; one that is late is killed and replaced."""

from __future__ import annotations

import functools
import logging
import math
import os
import signal
import traceback
from collections.abc import Iterator
from contextlib import contextmanager, suppress

import anyio
import anyio.to_process

from bsg_robot.service.questions import Answer, Service, refuse

SECONDS_TO_WAIT, SECONDS_TO_ANSWER = 60.0, 10.0
SECONDS_TO_END = 5.0  # for what is under way when the service is asked to end


class Pool:
    """Answers questions, one for each core at a time, 2 to 8; the others wait."""

    def __init__(self, model: str) -> None:
        number = max(2, min(os.cpu_count() or 2, 8))
        self._model = model
        self._turns = anyio.Semaphore(number)
        self._processes = anyio.CapacityLimiter(number)
        self._under_way: set[anyio.CancelScope] = set()
        self._end = math.inf  # when the service ends
        # asyncio warns if a process that is killed was waited for by another thread.
        logging.getLogger("asyncio").setLevel(logging.ERROR)

    async def start(self) -> None:
        """Have the processes that are free load the model, so that a question finds it."""
        async with anyio.create_task_group() as tasks:
            for _ in range(int(self._processes.available_tokens)):
                tasks.start_soon(self._run, "", b"")

    def end(self) -> None:
        """Give what is under way some seconds."""
        self._end = anyio.current_time() + SECONDS_TO_END
        for scope in self._under_way:
            scope.deadline = min(scope.deadline, self._end)

    async def answer(self, path: str, body: bytes) -> Answer:
        """Return the answer to one of `QUESTIONS`, or why there is none."""
        try:
            with self._limit(SECONDS_TO_WAIT):
                await self._turns.acquire()
        except TimeoutError:
            return self._refuse("too many questions at a time; ask again", code="busy")
        try:
            return await self._answer_in_time(path, body)
        finally:
            self._turns.release()

    async def _answer_in_time(self, path: str, body: bytes) -> Answer:
        try:
            with self._limit(SECONDS_TO_ANSWER):
                return await self._run(path, body)
        except TimeoutError:
            fault = f"no answer within {SECONDS_TO_ANSWER:g} s; ask about fewer rooms or things"
            refusal = self._refuse(fault, code="answer-late")
        except anyio.BrokenWorkerProcess:
            fault = "the process of this question was killed; ask about less, or again"
            refusal = self._refuse(fault, code="answer-killed")
        with suppress(TimeoutError), self._limit(SECONDS_TO_WAIT):
            await self.start()  # a new process, in the time of this client
        return refusal

    @contextmanager
    def _limit(self, seconds: float) -> Iterator[None]:
        """Let the block take so long, or until the service ends; then raise TimeoutError."""
        with anyio.fail_after(min(seconds, self._end - anyio.current_time())) as scope:
            self._under_way.add(scope)
            try:
                yield
            finally:
                self._under_way.discard(scope)

    async def _run(self, path: str, body: bytes) -> Answer:
        answer: Answer = await anyio.to_process.run_sync(
            _answer, self._model, path, body, cancellable=True, limiter=self._processes
        )
        return answer

    def _refuse(self, fault: str, *, code: str) -> Answer:
        if anyio.current_time() >= self._end:
            fault, code = "the service ends; ask again when it runs", "service-ending"
        return refuse(503, fault, code=code)


def _answer(model: str, path: str, body: bytes) -> Answer:
    """Answer in a process of the pool; the error that it raises says where it comes from."""
    try:
        service = _open(model)
        return service.answer(path, body) if path else Answer(204, b"")
    except Exception:
        raise RuntimeError(traceback.format_exc()) from None


@functools.cache
def _open(model: str) -> Service:
    for number in (signal.SIGINT, signal.SIGTERM):  # the listening process ends this one
        signal.signal(number, signal.SIG_IGN)
    return Service(model)
