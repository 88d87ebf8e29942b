"""Bounds of a request: bytes, time, kind, and the bytes of all requests together."""

from __future__ import annotations

from collections.abc import Awaitable, Callable

import anyio
from starlette.datastructures import Headers
from starlette.responses import JSONResponse, Response
from starlette.types import Receive, Scope, Send

from bsg_data.inputs.bounds import MIB
from bsg_data.recipes import Record

MOST_BYTES = 8 * MIB  # of a question
MOST_HELD = 256 * MIB  # of all questions at a time
SECONDS_TO_ASK = 30.0
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


class Bounds:
    """Reads a question whole, and lets it be answered if it is within its bounds."""

    def __init__(self, answer: Answering) -> None:
        self._answer = answer
        self._held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        body, size = bytearray(), 0
        try:
            response = await self._read(scope, receive, body)
            if response is None:
                said, size = bytes(body), len(body)
                body.clear()
                response = await self._answer(scope, said, receive)
        except anyio.get_cancelled_exc_class():  # nothing else ends a request than the whole end
            response = refuse(503, ENDING, code="service-ending")
        finally:
            self._held -= size or len(body)
        with anyio.CancelScope(shield=True), anyio.move_on_after(SECONDS_TO_ASK):
            await response(scope, receive, send)

    async def _read(self, scope: Scope, receive: Receive, body: bytearray) -> Response | None:
        """Read the body; a fault is told once all has come, for then a client listens."""
        fault, more = _check_headers(Headers(scope=scope), scope["method"]), True
        with anyio.move_on_after(SECONDS_TO_ASK) as timer:
            while more:
                message = await receive()
                if message["type"] == "http.disconnect":
                    return refuse(408, "the question has no end", code="question-slow")
                piece = message.get("body", b"")
                more = message.get("more_body", False)
                fault = fault or self._check_size(len(body) + len(piece), len(piece))
                if fault is None:
                    body += piece
                    self._held += len(piece)
        if timer.cancelled_caught:
            said = f"expected a question within {SECONDS_TO_ASK:g} s"
            return refuse(408, said, code="question-slow")
        return fault

    def _check_size(self, asked: int, piece: int) -> Response | None:
        if asked > MOST_BYTES:
            return _refuse_size()
        if self._held + piece > MOST_HELD:
            return refuse(503, "too many large questions at a time; ask again", code="busy")
        return None


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
