"""The service on a port: HTTP with an OpenAPI description, and MCP at /mcp."""

from __future__ import annotations

import logging
import re
import socket
from collections.abc import Awaitable, Callable, Sequence
from importlib.metadata import version
from typing import Any

import anyio
import uvicorn
from fastapi import FastAPI, Request, Response
from mcp.server.transport_security import TransportSecuritySettings
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect
from starlette.routing import Route

from bsg_data.words.shown import SHOWN
from bsg_robot.service.pool import SECONDS_TO_END, Pool
from bsg_robot.service.questions import QUESTIONS, Answer, Fault, refuse
from bsg_robot.service.tools import Answering, make_server

MOST_BYTES = 2 * 2**20  # of a question
MOST_CONNECTIONS = 200  # at a time
LOCAL = ("localhost", "127.0.0.1", "[::1]")
_log = logging.getLogger(__name__)
_PORT = re.compile(r":[0-9]+$")
_FAULTS = {
    400: "not JSON, or an unknown Host",
    404: "no such path",
    405: "not POST",
    413: "the question is too large",
    415: "not application/json",
    422: "the map or the question is faulty; `error` says where",
    500: "an error of the service",
    503: "too many questions at a time, the answer took too long, or the service ends",
}


def make_app(answer: Answering, *, hosts: Sequence[str] = LOCAL) -> FastAPI:
    """Return the application.

    Args:
        answer: gives the answer to a question: its path, and its JSON.
        hosts: names in lower case by which this machine may be asked.
    """
    server = make_server(answer)
    # Every POST is answered alone, without sessions or streams; `_checking_host` has checked it.
    mcp = server.streamable_http_app(
        json_response=True,
        stateless_http=True,
        max_request_body_size=MOST_BYTES,
        transport_security=TransportSecuritySettings(enable_dns_rebinding_protection=False),
    )
    app = FastAPI(
        title="Belief Scene Graphs",
        summary="Where things probably are in a building that a robot has partly seen.",
        version=version("belief-scene-graphs"),
        docs_url=None,  # its page loads scripts from elsewhere
        redoc_url=None,
        redirect_slashes=False,
        lifespan=lambda _: server.session_manager.run(),
        responses={code: {"model": Fault, "description": what} for code, what in _FAULTS.items()},
    )
    app.router.routes.append(Route("/mcp", mcp, methods=["POST"]))
    app.exception_handler(HTTPException)(_explain_path)
    app.exception_handler(Exception)(_confess)

    app.middleware("http")(_checking_host(hosts))
    for path, question in QUESTIONS.items():
        schema = {"schema": question.asks.model_json_schema()}
        body = {"required": True, "content": {"application/json": schema}}
        app.post(
            f"/{path}",
            operation_id=path,
            description=question.asks.__doc__,
            responses={200: {"model": question.answers}},
            openapi_extra={"requestBody": body},
        )(_answering(answer, path))
    return app


def _checking_host(hosts: Sequence[str]) -> Callable[[Request, Any], Awaitable[Any]]:
    """Refuse pages of other names, also of one that leads to this machine (DNS rebinding)."""

    async def check_host(request: Request, call_next: Any) -> Any:
        origin = request.headers.get("origin", "").rpartition("://")[2]
        for host in (request.headers.get("host") or "none", *filter(None, [origin])):
            if _PORT.sub("", host).lower() not in hosts:
                fault = (
                    f"host {host[:SHOWN]!r} is not known here; if you trust it, start "
                    "bsg-serve with --allow-host NAME"
                )
                return _respond(refuse(400, fault, code="host-unknown", where=host[:SHOWN]))
        return await call_next(request)

    return check_host


def _answering(answer: Answering, path: str) -> Callable[[Request], Awaitable[Response]]:
    async def respond(request: Request) -> Response:
        # Other kinds a page in a browser may send elsewhere without asking.
        kind = request.headers.get("content-type", "").partition(";")[0].strip().lower()
        if kind != "application/json":
            fault = f"expected the header Content-Type: application/json, found {kind[:SHOWN]!r}"
            return _respond(refuse(415, fault, code="content-type"))
        body = bytearray()
        try:
            async for piece in request.stream():
                body += piece
                if len(body) > MOST_BYTES:
                    fault = f"expected at most {MOST_BYTES:,} bytes; ask about a part"
                    return _respond(refuse(413, fault, code="question-too-large"))
        except ClientDisconnect:
            return Response(status_code=400)  # which nobody hears
        response = Response(status_code=400)
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(_leave_with_client, request, tasks.cancel_scope)
            response = _respond(await answer(path, bytes(body)))
            tasks.cancel_scope.cancel()
        return response

    return respond


async def _leave_with_client(request: Request, answering: anyio.CancelScope) -> None:
    """Let nobody's question hold a process: after the body, only that the client left is heard."""
    await request.receive()
    answering.cancel()


def _respond(answer: Answer) -> Response:
    return Response(answer.body, answer.status, media_type="application/json")


async def _explain_path(request: Request, error: Exception) -> Response:
    status, what = error.status_code, f"{request.method} {request.url.path[:SHOWN]}"  # type: ignore[attr-defined]
    fault = f"expected POST /find, /next_place, /expect or /mcp, or GET /openapi.json; found {what}"
    return _respond(refuse(status, fault, code="path-unknown"))


async def _confess(_: Request, error: Exception) -> Response:
    _log.error("a question failed", exc_info=error)
    fault = "an error of the service; its terminal says more"
    return _respond(refuse(500, fault, code="service-error"))


class _Server(uvicorn.Server):  # type: ignore[misc]
    """Starts and ends the processes that answer."""

    def __init__(self, config: uvicorn.Config, pool: Pool) -> None:
        super().__init__(config)
        self._pool = pool

    async def startup(self, sockets: list[socket.socket] | None = None) -> None:
        await self._pool.start()
        await super().startup(sockets)

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._pool.end()
        await super().shutdown(sockets)


def listen(model: str, door: socket.socket, *, hosts: Sequence[str] = ()) -> None:
    """Serve until the process is asked to end.

    Args:
        model: that answers.
        door: a socket that listens.
        hosts: names besides this machine's own that may be in Host.
    """
    pool = Pool(model)
    config = uvicorn.Config(
        make_app(pool.answer, hosts=(*LOCAL, *map(str.lower, hosts))),
        http="h11",
        ws="none",
        lifespan="on",
        log_level="critical",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=MOST_CONNECTIONS,
        timeout_graceful_shutdown=int(SECONDS_TO_END) + 2,
    )
    _Server(config, pool).run(sockets=[door])
