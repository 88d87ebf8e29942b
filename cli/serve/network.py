"""Listening: on a port, with places for those who ask; or on stdin, for one agent."""

from __future__ import annotations

import functools
import json
import re
import resource
import socket
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from typing import Any, BinaryIO

import anyio
import uvicorn
from mcp.server.stdio import stdio_server
from uvicorn.protocols.http.h11_impl import H11Protocol

from bsg_cli.serve.bounds import MOST_BYTES, SECONDS_TO_ASK, Bounds
from bsg_cli.serve.doors import LOCAL, KnownHosts
from bsg_cli.serve.processes import Processes
from bsg_cli.serve.tools import make_server
from bsg_data.files import encode_json
from bsg_data.inputs.bounds import MIB
from bsg_data.inputs.documents import parse_json
from bsg_data.spelling import SHOWN

MOST_CONNECTIONS = 2000
_SECONDS_TO_END = 8  # for the questions that are under way
_ENDS = 200  # bytes at both ends of a line, where its id is
_ID = re.compile(rb'"id"\s*:\s*(\d{1,18}|"[\w-]{1,80}")')


class _Connection(H11Protocol):  # type: ignore[misc]
    """Keeps its place while its whole question is here; else others may need it.

    Who has never asked goes first, then who was answered; of each, who has waited longest.
    """

    def __init__(self, *args: Any, waiting: tuple[dict[Any, None], ...], **options: Any) -> None:
        super().__init__(*args, **options)
        self._waiting = waiting

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        never_asked, _ = self._waiting
        never_asked[self] = None
        if len(self.connections) > MOST_CONNECTIONS:
            oldest = next(iter(self._waiting[0] or self._waiting[1]))
            oldest.transport.abort()
            oldest.connections.discard(oldest)
            oldest._leave()

    def data_received(self, data: bytes) -> None:
        """Note when the whole question has come."""
        super().data_received(data)
        if self._has_asked():
            self._leave()

    def on_response_complete(self) -> None:
        """Wait for the next question, but not for ever until this answer is read."""
        super().on_response_complete()
        if not self._has_asked():
            self._waiting[1][self] = None
        self.loop.call_later(SECONDS_TO_ASK, self._forget, self.cycle)

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._leave()

    def _has_asked(self) -> bool:
        cycle = self.cycle
        return cycle is not None and not (cycle.more_body or cycle.response_complete)

    def _leave(self) -> None:
        for waiting in self._waiting:
            waiting.pop(self, None)

    def _forget(self, answered: object) -> None:
        if self.cycle is answered and self.transport.get_write_buffer_size():
            self.transport.abort()


class _Server(uvicorn.Server):  # type: ignore[misc]
    """Starts the processes first, and refuses the questions that wait when it is asked to end."""

    def __init__(self, config: uvicorn.Config, processes: Processes) -> None:
        super().__init__(config)
        self._processes = processes

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await self._processes.start()
        await super().startup(sockets)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._processes.end()
        await super().shutdown(sockets)


def listen(model: str, door: socket.socket, *, hosts: Sequence[str] = ()) -> None:
    """Serve until the process is asked to end."""
    most, allowed = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 3 * MOST_CONNECTIONS
    if most < wanted and (allowed < 0 or most < allowed):
        wanted = wanted if allowed < 0 else min(wanted, allowed)
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, allowed))
    processes = Processes(model)
    config = uvicorn.Config(
        KnownHosts(Bounds(processes), hosts=(*LOCAL, *hosts)),
        http=functools.partial(_Connection, waiting=({}, {})),
        ws="none",
        lifespan="off",
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=2 * MOST_CONNECTIONS,  # that have asked, or are about to end
        timeout_graceful_shutdown=_SECONDS_TO_END,
    )
    _Server(config, processes).run(sockets=[door])


def speak(model: str) -> None:
    """Answer an agent on stdin and stdout until it leaves."""

    async def run() -> None:
        processes = Processes(model)
        server = make_server(Bounds(processes))
        said = anyio.wrap_file(_BoundedLines(sys.stdin.buffer, sys.stdout.buffer))
        answered = anyio.wrap_file(TextIOWrapper(sys.stdout.buffer, encoding="utf-8"))
        async with stdio_server(stdin=said, stdout=answered) as streams:
            await server.run(*streams, server.create_initialization_options())

    anyio.run(run)


class _BoundedLines:
    """Lines of JSON that an agent says; what is none, or out of bounds, is refused at once."""

    def __init__(self, said: BinaryIO, answered: BinaryIO) -> None:
        self._said, self._answered = said, answered

    def readline(self) -> str:
        while line := self._said.readline(MOST_BYTES + 1):
            try:
                if len(line) > MOST_BYTES:
                    line = line[:_ENDS] + self._read_end()
                    raise ValueError(f"expected at most {MOST_BYTES:,} bytes")
                parse_json(line)
            except ValueError as fault:
                self._refuse(line, str(fault)[:SHOWN])
            else:
                return line.decode("utf-8", "replace")
        return ""

    def _read_end(self) -> bytes:
        end = b""
        while (piece := self._said.readline(MIB)) and not piece.endswith(b"\n"):
            end = piece
        return (end + piece)[-_ENDS:]

    def _refuse(self, line: bytes, why: str) -> None:
        number = _ID.search(line[:_ENDS]) or _ID.search(line[-_ENDS:])
        error = {"code": -32600, "message": f"{why}; ask without meshes, or about a part"}
        answer = {"jsonrpc": "2.0", "id": json.loads(number[1]) if number else None, "error": error}
        self._answered.write(encode_json(answer).encode() + b"\n")
        self._answered.flush()
