"""Listening on a port: places for those who ask, and an end in order."""

from __future__ import annotations

import asyncio
import functools
import resource
import socket
from collections.abc import Callable, Sequence
from itertools import chain
from typing import Any

import uvicorn
from uvicorn.protocols.http.h11_impl import H11Protocol

from bsg_robot.service.bounds import SECONDS_TO_ASK, Bounds
from bsg_robot.service.doors import LOCAL, KnownHosts
from bsg_robot.service.processes import SECONDS_TO_END, Processes

MOST_CONNECTIONS = 2000
_KEPT_FILES = 100  # of those that a process may open, for all but connections


class _Places:
    """The connections that may have to go: whose question is not here, or is answered."""

    def __init__(self, most: int) -> None:
        self.most = most
        self.strangers: dict[_Connection, None] = {}  # that never asked, the oldest first
        self.answered: dict[_Connection, None] = {}

    def leave(self, connection: _Connection) -> None:
        """Forget a connection."""
        for waiting in (self.strangers, self.answered):
            waiting.pop(connection, None)

    def make_room(self) -> None:
        """End the connection that has waited longest, of those that never asked if there are."""
        oldest = next(chain(self.strangers, self.answered), None)
        if oldest is not None:
            oldest.transport.abort()
            oldest.connections.discard(oldest)
            self.leave(oldest)


class _Connection(H11Protocol):  # type: ignore[misc]
    """Has a place of its own from the last byte of a question until its answer.

    Otherwise a newcomer may take its place. A client that does not read its answer loses it, too.
    """

    def __init__(self, *args: Any, places: _Places, **options: Any) -> None:
        super().__init__(*args, **options)
        self._places = places
        self._unread: Any = None  # the timer of an answer that the client does not read

    def connection_made(self, transport: Any) -> None:
        super().connection_made(transport)
        if len(self.connections) > self._places.most:
            self._places.make_room()
        self._places.strangers[self] = None

    def data_received(self, data: bytes) -> None:
        """Note when the whole question has come."""
        super().data_received(data)
        if self._has_asked():
            self._places.leave(self)

    def on_response_complete(self) -> None:
        """Wait for the next question."""
        super().on_response_complete()
        if not self._has_asked():
            self._places.answered[self] = None

    def pause_writing(self) -> None:
        """End the connection if the client does not read on."""
        super().pause_writing()
        self._unread = self.loop.call_later(SECONDS_TO_ASK, self.transport.abort)

    def resume_writing(self) -> None:
        """Go on: the client reads."""
        super().resume_writing()
        if self._unread is not None:
            self._unread.cancel()

    def connection_lost(self, exc: Exception | None) -> None:
        super().connection_lost(exc)
        self._places.leave(self)
        if self._unread is not None:
            self._unread.cancel()

    def _has_asked(self) -> bool:
        cycle = self.cycle
        return cycle is not None and not (cycle.more_body or cycle.response_complete)


class _Server(uvicorn.Server):  # type: ignore[misc]
    """Starts the processes first, and refuses what comes and waits when it is asked to end."""

    def __init__(
        self,
        config: uvicorn.Config,
        bounds: Bounds,
        processes: Processes,
        announce: Callable[[], None],
    ) -> None:
        super().__init__(config)
        self._bounds, self._processes, self._announce = bounds, processes, announce

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await self._processes.start()
        await super().startup(sockets)
        self._announce()

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._bounds.end()
        self._processes.end()
        asyncio.get_running_loop().call_later(SECONDS_TO_END + 0.5, self._abort)
        await super().shutdown(sockets)

    def _abort(self) -> None:
        """End the connections whose clients do not read, before uvicorn complains of them."""
        for connection in [*self.server_state.connections]:
            connection.transport.abort()


def listen(
    model: str, door: socket.socket, *, announce: Callable[[], None], hosts: Sequence[str] = ()
) -> None:
    """Serve until the process is asked to end.

    Args:
        model: that answers.
        door: a socket that listens.
        announce: called when questions are answered.
        hosts: names besides this machine's own that may be in Host.
    """
    processes, most = Processes(model), _allow_files()
    bounds = Bounds(processes)
    config = uvicorn.Config(
        KnownHosts(bounds, hosts=(*LOCAL, *hosts)),
        http=functools.partial(_Connection, places=_Places(most)),
        ws="none",
        lifespan="off",
        log_level="error",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=2 * most,  # that have asked, or are about to end
        timeout_graceful_shutdown=SECONDS_TO_END + 1,
    )
    _Server(config, bounds, processes, announce).run(sockets=[door])


def _allow_files() -> int:
    """Let this process open as many files as it needs; return the connections that it may have."""
    limit, most = resource.getrlimit(resource.RLIMIT_NOFILE)
    wanted = 2 * MOST_CONNECTIONS + _KEPT_FILES
    if most != resource.RLIM_INFINITY:
        wanted = min(wanted, most)
    if limit != resource.RLIM_INFINITY and limit < wanted:
        resource.setrlimit(resource.RLIMIT_NOFILE, (wanted, most))
    return min(MOST_CONNECTIONS, (wanted - _KEPT_FILES) // 2)
