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
from contextlib import AsyncExitStack

import anyio
import anyio.to_process
from starlette.responses import Response
from starlette.types import ASGIApp, Receive, Scope

from bsg_cli.serve.answer import Answer, call
from bsg_cli.serve.bounds import confess, refuse
from bsg_data.inputs.bounds import KIB

SMALL = 32 * KIB  # a question that has a process kept free of larger ones
SECONDS_TO_WAIT, SECONDS_TO_ANSWER = 60.0, 10.0
_KEPT = ("method", "path", "query_string", "headers")  # of a request, for the process
_Headers = Iterable[tuple[bytes, bytes]]


class Processes:
    """Answers questions as many at a time as there are cores; the others wait."""

    def __init__(self, model: str) -> None:
        self._model = model
        number = max(2, min(os.cpu_count() or 2, 8))
        self._limiter = anyio.CapacityLimiter(number)
        self._free, self._free_for_large = anyio.Semaphore(number), anyio.Semaphore(number - 1)
        self._waiting: set[anyio.CancelScope] = set()
        self._is_ending = False

    async def start(self) -> None:
        """Start the processes, so that the first question finds the model loaded."""
        async with anyio.create_task_group() as tasks:
            for _ in range(int(self._limiter.total_tokens)):
                tasks.start_soon(self._run, None, b"")

    def end(self) -> None:
        """Answer what is under way, and refuse what waits and what comes."""
        self._is_ending = True
        for waiting in self._waiting:
            waiting.cancel()

    async def __call__(self, scope: Scope, body: bytes, receive: Receive) -> Response:
        """Answer a question, unless the client leaves before it is its turn."""
        async with AsyncExitStack() as turn:
            with anyio.move_on_after(SECONDS_TO_WAIT) as waiting:
                self._waiting.add(waiting)
                async with anyio.create_task_group() as tasks:
                    tasks.start_soon(_cancel_without_client, receive, waiting)
                    if len(body) > SMALL:
                        await turn.enter_async_context(self._free_for_large)
                    await turn.enter_async_context(self._free)
                    tasks.cancel_scope.cancel()
            self._waiting.discard(waiting)
            if self._is_ending:
                said = "the service ends; ask again when it runs"
                return refuse(503, said, code="service-ending")
            if waiting.cancelled_caught:
                return refuse(503, "too many questions at a time; ask again", code="busy")
            return await self._run({key: scope[key] for key in _KEPT}, body)

    async def _run(self, scope: Scope | None, body: bytes) -> Response:
        answer = None
        with anyio.move_on_after(SECONDS_TO_ANSWER):
            try:
                answer = await anyio.to_process.run_sync(
                    _answer, self._model, scope, body, cancellable=True, limiter=self._limiter
                )
            except anyio.BrokenWorkerProcess:
                said = "the process of this question was killed; ask about less, or again"
                return refuse(503, said, code="answer-killed")
        if answer is None:
            said = f"no answer within {SECONDS_TO_ANSWER:g} s; ask about fewer rooms or things"
            return refuse(503, said, code="answer-late")
        if answer.traceback:
            logging.getLogger("uvicorn.error").error(answer.traceback)
        return Response(answer.body, answer.status, dict(_decode(answer.headers)))


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
    from bsg_cli.serve.http import make_app
    from bsg_cli.serve.questions import Service

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
