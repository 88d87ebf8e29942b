"""Processes that answer: each takes one question at a time, and is killed when its time is over.

The listening process parses nothing that strangers write, so that no question delays another.
"""

from __future__ import annotations

import asyncio
import functools
import logging
import os
import signal
import traceback
from collections.abc import Iterable
from contextlib import AsyncExitStack, suppress

import anyio
import anyio.to_process
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope

from bsg_data.errors import BSGError
from bsg_robot.service.answer import Answer, call
from bsg_robot.service.bounds import ENDING, confess, refuse
from bsg_robot.service.turns import Turns

SMALL = 32 * 2**10  # a question that has a process kept free of larger ones
SECONDS_TO_WAIT, SECONDS_TO_ANSWER = 60.0, 10.0
SECONDS_TO_LOAD = 60.0  # a model, at the start
SECONDS_TO_END = 7  # for what is under way when the service is asked to end
_SECONDS_LOST = 0.5  # within which a process fails that was killed before it was asked
_KEPT = ("method", "path", "query_string", "headers")  # of a request, for the process
_Headers = Iterable[tuple[bytes, bytes]]


class Processes:
    """Answers questions, one for each core at a time, 2 to 8; the others wait."""

    def __init__(self, model: str) -> None:
        self._model = model
        number = max(2, min(os.cpu_count() or 2, 8))
        self._limiter = anyio.CapacityLimiter(number)
        self._turns = Turns(number)
        self._waiting: set[anyio.CancelScope] = set()
        self._running: set[anyio.CancelScope] = set()
        self._is_ending = False
        # asyncio warns if a process that is killed was waited for by another thread.
        logging.getLogger("asyncio").setLevel(logging.ERROR)

    @property
    def is_busy(self) -> bool:
        """Whether a question is under way, or waits."""
        return bool(self._waiting or self._running)

    async def start(self) -> None:
        """Start the processes, so that the first question finds the model loaded.

        Raises:
            BSGError: if they do not start, or it takes too long.
        """
        number = int(self._limiter.total_tokens)
        if (started := await self._load(number)) < number:
            raise BSGError(
                f"{started} of {number} processes that answer started within "
                f"{SECONDS_TO_LOAD:g} s; free some memory, and start again",
                code="process-missing",
            )

    async def _load(self, number: int) -> int:
        """Have so many processes load the model at a time; return how many did."""
        started: list[Answer] = []

        async def load_one() -> None:
            with suppress(anyio.BrokenWorkerProcess):
                started.append(await self._ask(None, b""))

        with anyio.move_on_after(SECONDS_TO_LOAD) as running:
            self._running.add(running)
            async with anyio.create_task_group() as tasks:
                for _ in range(number):
                    tasks.start_soon(load_one)
        self._running.discard(running)
        return len(started)

    def end(self) -> None:
        """Give what is under way some seconds, and refuse what waits and what comes."""
        self._is_ending = True
        for waiting in self._waiting:
            waiting.cancel()
        for running in self._running:
            running.deadline = min(running.deadline, anyio.current_time() + SECONDS_TO_END)

    async def __call__(self, scope: Scope, body: bytes, receive: Receive) -> Response:
        """Answer a question, unless the client leaves before it is its turn."""
        async with AsyncExitStack() as turn:
            if self._is_ending or not await self._take_turn(turn, scope, body, receive):
                return self._refuse("busy", "too many questions at a time; ask again")
            with anyio.move_on_after(SECONDS_TO_ANSWER) as running:
                self._running.add(running)
                try:
                    kept = {key: scope[key] for key in _KEPT}
                    answer = await self._ask(kept, body)
                except anyio.BrokenWorkerProcess:
                    said = "the process of this question was killed; ask about less, or again"
                    return refuse(503, said, code="answer-killed")
                finally:
                    self._running.discard(running)
            if running.cancelled_caught:
                if not self._is_ending:  # a new process starts in the time of this client
                    await self._load(int(self._limiter.available_tokens))
                said = f"no answer within {SECONDS_TO_ANSWER:g} s; ask about fewer rooms or things"
                return self._refuse("answer-late", said)
        if answer.traceback:
            logging.getLogger("uvicorn.error").error(answer.traceback)
        return Response(answer.body, answer.status, dict(_decode(answer.headers)))

    async def _take_turn(
        self, turn: AsyncExitStack, scope: Scope, body: bytes, receive: Receive
    ) -> bool:
        """Wait until a process is free; return whether it is."""
        with anyio.move_on_after(SECONDS_TO_WAIT) as waiting:
            self._waiting.add(waiting)
            try:
                async with anyio.create_task_group() as tasks:
                    tasks.start_soon(_cancel_without_client, receive, waiting)
                    client, _ = scope.get("client") or ("", 0)
                    turns = self._turns.take(client, is_large=len(body) > SMALL)
                    await turn.enter_async_context(turns)
                    tasks.cancel_scope.cancel()
            finally:
                self._waiting.discard(waiting)
        return not (waiting.cancelled_caught or self._is_ending)

    async def _ask(self, scope: Scope | None, body: bytes) -> Answer:
        """Return the answer of a process; one that was killed while it was idle is replaced."""
        began = anyio.current_time()
        while True:
            try:
                answer: Answer = await anyio.to_process.run_sync(
                    _answer, self._model, scope, body, cancellable=True, limiter=self._limiter
                )
            except anyio.BrokenWorkerProcess:
                if anyio.current_time() - began > _SECONDS_LOST:
                    raise
            else:
                return answer

    def _refuse(self, code: str, said: str) -> Response:
        if self._is_ending:
            code, said = "service-ending", ENDING
        return refuse(503, said, code=code)


async def _cancel_without_client(receive: Receive, waiting: anyio.CancelScope) -> None:
    await receive()  # after the body, only that the client has left
    waiting.cancel()


def _decode(headers: _Headers) -> Iterable[tuple[str, str]]:
    return ((name.decode("latin-1"), value.decode("latin-1")) for name, value in headers)


# In a process that answers.


def _answer(model: str, scope: Scope | None, body: bytes) -> Answer:
    try:
        loop, app = _open(model)
    except Exception:  # a model that went after the start
        fault = confess()
        return Answer(fault.status_code, fault.raw_headers, fault.body, traceback.format_exc())
    return loop.run_until_complete(call(app, scope, body)) if scope else Answer(204, [], b"")


@functools.cache
def _open(model: str) -> tuple[asyncio.AbstractEventLoop, ASGIApp]:
    """Open the application once, in a loop that goes on with the next question."""
    from bsg_robot.service.http import make_app
    from bsg_robot.service.questions import Service

    for number in (signal.SIGINT, signal.SIGTERM):  # the listening process ends this one
        signal.signal(number, signal.SIG_IGN)
    app = make_app(Service(model))
    loop = asyncio.new_event_loop()
    opened = asyncio.Event()

    async def live() -> None:
        async with app.router.lifespan_context(app):
            opened.set()
            await anyio.sleep_forever()

    app.state.life = loop.create_task(live())  # a loop itself keeps no task
    loop.run_until_complete(opened.wait())
    return loop, app
