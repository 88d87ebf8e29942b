"""Speaking with one agent on stdin and stdout, within the bounds of all questions."""

from __future__ import annotations

import json
import os
import re
import signal
import sys
import time
from collections.abc import Callable
from io import TextIOWrapper
from typing import Any, BinaryIO

import anyio
from mcp.server.stdio import stdio_server

from bsg_data.files import encode_json
from bsg_data.inputs.documents import parse_json
from bsg_data.words.shown import SHOWN
from bsg_robot.service.bounds import MOST_BYTES, Bounds
from bsg_robot.service.processes import Processes
from bsg_robot.service.tools import make_server

_ENDS = 200  # bytes at both ends of a line, where its id is
_ID = rb'"id"\s*:\s*(\d{1,18}|"[\w-]{1,80}")'
_FIRST, _LAST = re.compile(_ID + rb"\s*[,}]"), re.compile(_ID + rb"\s*}\s*\Z")


def speak(model: str, note: Callable[[str], None]) -> None:
    """Answer an agent until it leaves, or the process is asked to end, which is noted."""

    async def run() -> None:
        processes = Processes(model)
        server = make_server(Bounds(processes))
        said = anyio.wrap_file(_BoundedLines(sys.stdin.buffer, sys.stdout.buffer, processes))
        answered = anyio.wrap_file(TextIOWrapper(sys.stdout.buffer, encoding="utf-8"))
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(_end_when_asked, processes, note)
            async with stdio_server(stdin=said, stdout=answered) as streams:
                await server.run(*streams, server.create_initialization_options())
            tasks.cancel_scope.cancel()

    anyio.run(run)


async def _end_when_asked(processes: Processes, note: Callable[[str], None]) -> None:
    """End after what is under way; a thread that waits for the agent would keep the process."""
    with anyio.open_signal_receiver(signal.SIGTERM, signal.SIGINT) as signals:
        async for number in signals:
            processes.end()
            while processes.is_busy:
                await anyio.sleep(0.02)
            await anyio.sleep(0.1)  # so that the last answer goes out
            note("asked to end" if number == signal.SIGTERM else "interrupted")
            os._exit(128 + number)  # as a shell says it


class _BoundedLines:
    """Lines of JSON-RPC that an agent says; what is none, or out of bounds, is refused at once."""

    def __init__(self, said: BinaryIO, answered: BinaryIO, processes: Processes) -> None:
        self._said, self._answered, self._processes = said, answered, processes

    def readline(self) -> str:
        """Return the next line that is a message; empty at the end, after the last answer."""
        while line := self._said.readline(MOST_BYTES + 1):
            if not line.strip():
                continue
            try:
                if len(line.rstrip(b"\r\n")) > MOST_BYTES:
                    line = line[:_ENDS] + self._read_end(line)
                    raise ValueError(f"expected at most {MOST_BYTES:,} bytes; ask about a part")
                _require_message(parse_json(line))
            except ValueError as fault:
                self._refuse(line, str(fault)[:SHOWN])
            else:
                return line.decode("utf-8", "replace")
        time.sleep(0.3)  # until the last question is under way
        while self._processes.is_busy:
            time.sleep(0.1)
        return ""

    def _read_end(self, line: bytes) -> bytes:
        while not line.endswith(b"\n") and (piece := self._said.readline(2**20)):
            line = line[-_ENDS:] + piece
        return line[-_ENDS:]

    def _refuse(self, line: bytes, why: str) -> None:
        start = line[:_ENDS].partition(b'"params"')[0]
        number = _LAST.search(line[-_ENDS:]) or _FIRST.search(start)
        error = {"code": -32600, "message": why}
        answer = {"jsonrpc": "2.0", "id": json.loads(number[1]) if number else None, "error": error}
        self._answered.write(encode_json(answer).encode() + b"\n")
        self._answered.flush()


def _require_message(document: Any) -> None:
    """Refuse what the protocol would drop without an answer."""
    is_message = (
        isinstance(document, dict)
        and document.get("jsonrpc") == "2.0"
        and ("method" in document or "result" in document or "error" in document)
        and type(document.get("id", 0)) in (int, str)
        and type(document.get("params", {})) is dict
    )
    if not is_message:
        raise ValueError("expected a JSON-RPC 2.0 message: id a number or a text, params an object")
