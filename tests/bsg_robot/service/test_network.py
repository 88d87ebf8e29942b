"""The end of the service: whoever still holds a connection then."""

from __future__ import annotations

import functools
import socket

import anyio
import pytest
import uvicorn
from starlette.responses import Response

from bsg_robot.service import network


class Nothing:
    """Stands for the bounds and the processes."""

    async def start(self) -> None:
        """Start nothing."""

    def end(self) -> None:
        """End nothing."""


def test_who_does_not_read_its_answer_goes_before_uvicorn_complains(
    monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    monkeypatch.setattr(network, "SECONDS_TO_END", -0.4)  # and half a second more
    config = uvicorn.Config(
        Response(b" " * 50_000_000),  # more than the buffers of a connection take
        http=functools.partial(network._Connection, places=network._Places(9)),
        lifespan="off",
        log_config=None,
        timeout_graceful_shutdown=3,
    )
    server = network._Server(config, Nothing(), Nothing(), announce=lambda: None)  # type: ignore[arg-type]

    async def run() -> None:
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(server.serve, [door])
            while not server.started:
                await anyio.sleep(0.01)
            client.connect(door.getsockname())
            client.sendall(b"GET / HTTP/1.1\r\nHost: localhost\r\n\r\n")
            await anyio.wait_readable(client)
            server.should_exit = True

    with socket.create_server(("127.0.0.1", 0)) as door, socket.socket() as client:
        anyio.run(run)
    assert "exceeded" not in caplog.text
