"""The door for everybody else: HTTP with an OpenAPI description; MCP is beside it, at /mcp."""

from __future__ import annotations

import socket
from collections.abc import Sequence
from importlib.metadata import version

import uvicorn
from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from mcp.server.mcpserver import MCPServer
from mcp.server.transport_security import TransportSecuritySettings
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.routing import Route

from bsg_cli.serve.bounds import MOST_BYTES, MOST_CONNECTIONS, Bounds, Fault, refuse
from bsg_cli.serve.doors import LOCAL, EventStreams, KnownHosts
from bsg_cli.serve.questions import ENDING, Contents, Expect, Find, Found, Service
from bsg_cli.serve.tools import make_server
from bsg_data.errors import BSGError
from bsg_data.spelling import SHOWN, ask_if_meant

_SECONDS_TO_END = 8  # for the questions that are under way
_FAULTS = {
    400: "not JSON, or an unknown Host",
    404: "no such path",
    405: "not POST",
    408: "the question came too slowly",
    413: "the question is too large",
    415: "not application/json",
    422: "the map or the question is faulty; `error` says where",
    500: "an error of the service",
    503: "too many questions at a time, the answer took too long, or the service ends",
}


def make_app(service: Service, *, hosts: Sequence[str] = ()) -> FastAPI:
    """Return the application; `hosts` are names besides this machine's own that may be in Host."""
    server = make_server(service)
    mcp = _mcp_route(server)
    app = FastAPI(
        title="Belief Scene Graphs",
        summary="Where things probably are in a building that a robot has partly seen.",
        version=version("belief-scene-graphs"),
        docs_url=None,  # its page loads scripts from elsewhere
        redoc_url=None,
        lifespan=lambda _: server.session_manager.run(),
        responses={code: {"model": Fault, "description": what} for code, what in _FAULTS.items()},
    )
    app.router.routes.append(mcp)
    app.add_middleware(Bounds)
    app.add_middleware(KnownHosts, hosts=(*LOCAL, *hosts))
    app.exception_handler(BSGError)(_explain)
    app.exception_handler(RequestValidationError)(_explain_question)
    app.exception_handler(HTTPException)(_explain_path)
    app.exception_handler(Exception)(_confess)

    async def find(asked: Find) -> Found:
        """Say in which rooms things probably are, and which room to search first."""
        return await service.find(asked)

    async def expect(asked: Expect) -> Contents:
        """Say what rooms probably hold that was not seen yet, of one room or of all."""
        return await service.expect(asked)

    for answer in (find, expect):
        app.post(f"/{answer.__name__}", operation_id=answer.__name__)(answer)
    return app


def _mcp_route(server: MCPServer) -> Route:
    """Return the route of MCP: every POST is answered alone, without sessions or streams."""
    checked = TransportSecuritySettings(enable_dns_rebinding_protection=False)  # by `KnownHosts`
    made = server.streamable_http_app(
        json_response=True,
        stateless_http=True,
        max_request_body_size=MOST_BYTES,
        transport_security=checked,
    )
    return Route("/mcp", EventStreams(made), methods=["POST"])


async def _explain(_: Request, error: Exception) -> JSONResponse:
    code = getattr(error, "code", "")
    status = 503 if code == ENDING else 422
    return refuse(status, str(error), code=code, where=getattr(error, "where", ""))


async def _explain_question(request: Request, error: Exception) -> JSONResponse:
    faults = error.errors()  # type: ignore[attr-defined]
    # A wrong key is named before the key that is missing for it.
    fault = next((one for one in faults if one["type"] == "extra_forbidden"), faults[0])
    where = ".".join(str(part)[:SHOWN] for part in fault["loc"][1:]) or "the question"
    is_whole = len(fault["loc"]) == 1
    said = "expected a JSON object" if is_whole else fault["msg"].removeprefix("Value error, ")
    if fault["type"] == "extra_forbidden":
        keys = (Find if request.url.path == "/find" else Expect).model_fields
        hint = ask_if_meant(where, keys) or f"known are {', '.join(keys)}"
        said = f"is no key; {hint}"
    return refuse(422, f"{where}: {said}", code="question-malformed", where=where)


async def _explain_path(request: Request, error: Exception) -> JSONResponse:
    status, what = error.status_code, f"{request.method} {request.url.path[:SHOWN]}"  # type: ignore[attr-defined]
    said = f"expected POST /find, /expect or /mcp, or GET /openapi.json; found {what}"
    return refuse(status, said, code="path-unknown")


async def _confess(_: Request, __: Exception) -> JSONResponse:
    return refuse(500, "an error of the service; its terminal says more", code="service-error")


class _Server(uvicorn.Server):  # type: ignore[misc]
    """Refuses the questions that wait when it is asked to end."""

    def __init__(self, config: uvicorn.Config, service: Service) -> None:
        super().__init__(config)
        self._service = service

    async def shutdown(self, sockets: list[socket.socket] | None = None) -> None:
        self._service.end()
        await super().shutdown(sockets)


def listen(service: Service, door: socket.socket, *, hosts: Sequence[str] = ()) -> None:
    """Serve until the process is asked to end."""
    config = uvicorn.Config(
        make_app(service, hosts=hosts),
        http="h11",
        ws="none",
        log_level="warning",
        access_log=False,
        proxy_headers=False,
        server_header=False,
        limit_concurrency=MOST_CONNECTIONS,
        timeout_graceful_shutdown=_SECONDS_TO_END,
    )
    _Server(config, service).run(sockets=[door])
