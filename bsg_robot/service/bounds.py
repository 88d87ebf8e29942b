"""Bounds of a request: bytes, time, kind, and the bytes of all requests together.

Where those are too many, the client whose questions hold most of them gives way.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from functools import partial

import anyio
from starlette.datastructures import Headers
from starlette.responses import JSONResponse, Response
from starlette.types import Message, Receive, Scope, Send

from bsg_data.records import Record

MOST_BYTES = 8 * 2**20  # of a question
MOST_HELD = 256 * 2**20  # of all questions at a time
SECONDS_TO_ASK = 30.0
_BUSY = "too many large questions at a time; ask again"
ENDING = "the service ends; ask again when it runs"

Answering = Callable[[Scope, bytes, Receive], Awaitable[Response]]


class Fault(Record):
    """Why there is no answer."""

    error: str
    code: str
    where: str


def refuse(status: int, error: str, *, code: str, where: str = "") -> JSONResponse:
    """Return a fault as a response."""
    return JSONResponse(Fault(error=error, code=code, where=where).model_dump(), status)


def confess() -> JSONResponse:
    """Return that the service itself has failed."""
    return refuse(500, "an error of the service; its terminal says more", code="service-error")


@dataclass(eq=False)
class _Question:
    """A question that comes, waits or is answered."""

    client: str
    held: int = 0  # bytes
    refusal: Response | None = None
    hearing: anyio.CancelScope | None = None  # while it comes or waits, not while it is answered

    async def hear(self, receive: Receive) -> Message:
        """Return what the client says next; that it has left, once the question is refused."""
        if self.refusal is None:
            with anyio.CancelScope() as self.hearing:
                try:
                    return await receive()
                finally:
                    self.hearing = None
        return {"type": "http.disconnect"}

    def refuse(self, why: Response) -> None:
        """Refuse it now, though its client may not have said all of it."""
        self.refusal = why
        if self.hearing is not None:
            self.hearing.cancel()


class Bounds:
    """Reads a question whole, and lets it be answered if it is within its bounds."""

    def __init__(self, answer: Answering) -> None:
        self._answer = answer
        self._questions: dict[_Question, None] = {}
        self._held = 0  # bytes of all
        self._is_ending = False

    def end(self) -> None:
        """Refuse the questions that still come, for the service ends."""
        self._is_ending = True
        for question in self._questions:
            question.refuse(refuse(503, ENDING, code="service-ending"))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        client, _ = scope.get("client") or ("", 0)
        question, body = _Question(client), bytearray()
        self._questions[question] = None
        if self._is_ending:
            question.refuse(refuse(503, ENDING, code="service-ending"))
        hear = partial(question.hear, receive)
        try:
            response = await self._read(question, scope, hear, body)
            if response is None:
                said = bytes(body)
                body.clear()
                response = await self._answer(scope, said, hear)
        except anyio.get_cancelled_exc_class():  # nothing else ends a request than the whole end
            response = refuse(503, ENDING, code="service-ending")
        finally:
            self._set_held(question, 0)
            del self._questions[question]
        with anyio.CancelScope(shield=True), anyio.move_on_after(SECONDS_TO_ASK):
            await response(scope, receive, send)

    async def _read(
        self, question: _Question, scope: Scope, hear: Receive, body: bytearray
    ) -> Response | None:
        """Read the body; a fault is told once all has come, for then a client listens."""
        fault, more = _check_headers(Headers(scope=scope), scope["method"]), True
        with anyio.move_on_after(SECONDS_TO_ASK) as timer:
            while more:
                message = await hear()
                if message["type"] == "http.disconnect":
                    late = refuse(408, "the question has no end", code="question-slow")
                    return question.refusal or late
                more = message.get("more_body", False)
                if fault is None:
                    body += message.get("body", b"")
                    fault = self._hold(question, len(body))
                if fault is not None:
                    body.clear()
        if timer.cancelled_caught:
            said = f"expected a question within {SECONDS_TO_ASK:g} s"
            return refuse(408, said, code="question-slow")
        return fault

    def _hold(self, question: _Question, size: int) -> Response | None:
        """Hold so many bytes of a question; others give way if their clients hold more."""
        if size > MOST_BYTES:
            self._set_held(question, 0)
            return _refuse_size()
        self._set_held(question, size)
        while self._held > MOST_HELD:
            largest, busy = self._find_largest(question), refuse(503, _BUSY, code="busy")
            self._set_held(largest, 0)
            if largest is question:
                return busy
            largest.refuse(busy)
        return None

    def _find_largest(self, question: _Question) -> _Question:
        """Return the largest question of the client that holds most, the newest of equal ones."""
        of_clients = Counter[str]()
        for one in self._questions:
            of_clients[one.client] += one.held
        may_go = [one for one in self._questions if one is question or (one.hearing and one.held)]
        return max(reversed(may_go), key=lambda one: (of_clients[one.client], one.held))

    def _set_held(self, question: _Question, size: int) -> None:
        self._held += size - question.held
        question.held = size


def _check_headers(headers: Headers, method: str) -> Response | None:
    """Refuse what is too large, and what a page in a browser may send elsewhere without asking."""
    kind = headers.get("content-type", "").partition(";")[0].strip().lower()
    if method == "POST" and kind != "application/json":
        said = f"expected the header Content-Type: application/json, found {kind[:80] or 'none'}"
        return refuse(415, said, code="content-type")
    return _refuse_size() if int(headers.get("content-length", 0)) > MOST_BYTES else None


def _refuse_size() -> Response:
    said = f"expected at most {MOST_BYTES:,} bytes; ask without meshes, or about a part"
    return refuse(413, said, code="question-too-large")
