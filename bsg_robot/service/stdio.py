"""Speaking MCP with one agent on stdin and stdout."""

from __future__ import annotations

import os
import signal
from collections.abc import Callable

import anyio
from mcp.server.stdio import stdio_server

from bsg_robot.service.pool import Pool
from bsg_robot.service.tools import make_server


def speak(model: str, note: Callable[[str], None]) -> None:
    """Answer an agent until it leaves, or the process is asked to end, which is noted."""

    def end(number: int, _: object) -> None:
        # At once: a thread that waits for the agent would keep the process.
        note("asked to end" if number == signal.SIGTERM else "interrupted")
        os._exit(128 + number)  # as a shell says it

    async def run() -> None:
        server = make_server(Pool(model).answer)
        async with stdio_server() as streams:
            await server.run(*streams, server.create_initialization_options())

    for number in (signal.SIGTERM, signal.SIGINT):
        signal.signal(number, end)
    anyio.run(run)
