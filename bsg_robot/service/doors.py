"""Who may come in, and in which form an answer goes out: one rule for HTTP and MCP."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

from starlette.datastructures import Headers, MutableHeaders
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bsg_data.words.shown import SHOWN
from bsg_robot.service.bounds import refuse

LOCAL = ("localhost", "127.0.0.1", "[::1]")
_PORT = re.compile(r":[0-9]+$")
_JSON, _EVENTS = "application/json", "text/event-stream"


class KnownHosts:
    """Refuses requests that were sent to another name, or come from a page of another origin."""

    def __init__(self, app: ASGIApp, *, hosts: Sequence[str]) -> None:
        self._app, self._hosts = app, frozenset(map(str.lower, hosts))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        if scope["type"] == "http":
            headers = Headers(scope=scope)
            origin = headers.get("origin", "")
            origin = origin.partition("://")[2] or origin
            for host in (headers.get("host") or "none", *filter(None, (origin,))):
                if _PORT.sub("", host).lower() not in self._hosts:
                    said = (
                        f"host {host[:SHOWN]!r} is not known here; if you trust it, start "
                        "bsg-serve with --allow-host NAME"
                    )
                    await refuse(400, said, code="host-unknown", where=host[:SHOWN])(
                        scope, receive, send
                    )
                    return
        await self._app(scope, receive, send)


class EventStreams:
    """Gives clients of MCP that take only an event stream their answer as its one event."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request."""
        accepted = Headers(scope=scope).get("accept", "")
        if _EVENTS not in accepted or _JSON in accepted or "*/*" in accepted:
            await self._app(scope, receive, send)
            return
        headers = MutableHeaders(raw=[*scope["headers"]])
        headers["accept"] = f"{_JSON}, {_EVENTS}"
        started: list[Message] = []
        body = bytearray()

        async def collect(message: Any) -> None:
            if message["type"] == "http.response.start":
                started.append(message)
                return
            body.extend(message.get("body", b""))
            if not message.get("more_body", False):
                await _send_event(started[0], bytes(body), send)

        await self._app({**scope, "headers": headers.raw}, receive, collect)


async def _send_event(start: Message, body: bytes, send: Send) -> None:
    headers = MutableHeaders(raw=[*start["headers"]])
    if headers.get("content-type", "").startswith(_JSON) and body:
        body = b"event: message\r\ndata: " + body + b"\r\n\r\n"
        headers["content-type"] = _EVENTS
    headers["content-length"] = str(len(body))
    await send({**start, "headers": headers.raw})
    await send({"type": "http.response.body", "body": body})
