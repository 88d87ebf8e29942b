"""What an application answers to one request."""

from __future__ import annotations

import traceback
from typing import NamedTuple

import anyio
from starlette.types import ASGIApp, Message, Scope


class Answer(NamedTuple):
    """What an application answers to a request, and what its author should know of it."""

    status: int
    headers: list[tuple[bytes, bytes]]
    body: bytes
    traceback: str = ""


async def call(app: ASGIApp, scope: Scope, body: bytes) -> Answer:
    """Call an application in this process; what it raises after its answer is in the answer."""
    sent: list[Message] = []
    left: list[Message] = [{"type": "http.request", "body": body, "more_body": False}]

    async def receive() -> Message:
        if left:
            return left.pop()
        await anyio.sleep_forever()
        raise AssertionError

    async def send(message: Message) -> None:
        sent.append(message)

    said = ""
    try:
        await app({"type": "http", **scope}, receive, send)
    except Exception:
        if not sent:
            raise
        said = traceback.format_exc()
    start, *pieces = sent
    whole = b"".join(piece.get("body", b"") for piece in pieces)
    return Answer(start["status"], [*start["headers"]], whole, said)
