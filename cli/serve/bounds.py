"""Bounds of a request: bytes, time, kind, and the bytes of all requests together."""

from __future__ import annotations

import anyio
from starlette.datastructures import Headers
from starlette.responses import JSONResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bsg_data.inputs.bounds import MIB
from bsg_data.inputs.documents import parse_json
from bsg_data.recipes import Record

MOST_BYTES = 8 * MIB  # of a question
MOST_HELD = 256 * MIB  # of all questions at a time
MOST_CONNECTIONS = 2000
SECONDS_TO_ASK, SECONDS_TO_ANSWER = 30.0, 60.0


class Fault(Record):
    """Why there is no answer."""

    error: str
    code: str
    where: str


def refuse(status: int, error: str, *, code: str, where: str = "") -> JSONResponse:
    """Return a fault as a response."""
    return JSONResponse(Fault(error=error, code=code, where=where).model_dump(), status)


class Bounds:
    """Reads a question whole before anything is done with it, and ends an answer in time."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app
        self._held = 0

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        body = bytearray()
        try:
            fault = await self._read(scope, receive, body)
            fault = fault or await self._answer(scope, receive, send, bytes(body))
            if fault is not None:
                await fault(scope, receive, send)
        finally:
            self._held -= len(body)

    async def _read(self, scope: Scope, receive: Receive, body: bytearray) -> Response | None:
        """Read the body; a fault is told once all has come, for then a client listens."""
        fault, more = _check_headers(Headers(scope=scope), scope["method"]), True
        with anyio.move_on_after(SECONDS_TO_ASK) as timer:
            while more:
                message = await receive()
                piece = message.get("body", b"")
                more = message.get("more_body", False)
                fault = fault or self._check_size(len(body) + len(piece), len(piece))
                if fault is None:
                    body += piece
                    self._held += len(piece)
        if timer.cancelled_caught:
            said = f"expected a question within {SECONDS_TO_ASK:g} s"
            return refuse(408, said, code="question-slow")
        return fault or _check_json(body)

    def _check_size(self, asked: int, piece: int) -> Response | None:
        if asked > MOST_BYTES:
            return _refuse_size()
        if self._held + piece > MOST_HELD:
            return refuse(503, "too many large questions at a time; ask again", code="busy")
        return None

    async def _answer(
        self, scope: Scope, receive: Receive, send: Send, body: bytes
    ) -> Response | None:
        began, told = False, False

        async def replay() -> Message:
            nonlocal told
            if told:
                return await receive()
            told = True
            return {"type": "http.request", "body": body, "more_body": False}

        async def watch(message: Message) -> None:
            nonlocal began
            began = True
            await send(message)

        async def leave(answering: anyio.CancelScope) -> None:
            await receive()  # after the body, only that the client has left
            answering.cancel()

        with anyio.move_on_after(SECONDS_TO_ANSWER):
            async with anyio.create_task_group() as tasks:
                tasks.start_soon(leave, tasks.cancel_scope)
                await self._app(scope, replay, watch)
                tasks.cancel_scope.cancel()
        if began:
            return None
        said = f"no answer within {SECONDS_TO_ANSWER:g} s; ask about fewer rooms, or again"
        return refuse(503, said, code="answer-late")


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


def _check_json(body: bytearray) -> Response | None:
    try:
        if body:
            parse_json(bytes(body))
    except ValueError as error:
        return refuse(400, f"no JSON ({str(error)[:200]})", code="json-malformed")
    return None
