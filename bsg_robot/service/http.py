"""The application: HTTP with an OpenAPI description; MCP is beside it, at /mcp."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from importlib.metadata import version
from typing import Any

from fastapi import FastAPI, Request, Response
from fastapi.exceptions import RequestValidationError
from fastapi.routing import APIRoute
from mcp.server.lowlevel import Server
from mcp.server.transport_security import TransportSecuritySettings
from starlette.exceptions import HTTPException
from starlette.responses import JSONResponse
from starlette.routing import Route
from starlette.types import ASGIApp, Message, Receive, Scope, Send

from bsg_data.errors import BSGError
from bsg_data.inputs.documents import parse_json
from bsg_data.words.nearest import ask_if_meant
from bsg_data.words.shown import SHOWN
from bsg_robot.service.bounds import MOST_BYTES, Fault, confess, refuse
from bsg_robot.service.doors import EventStreams
from bsg_robot.service.questions import QUESTIONS, Question, Service
from bsg_robot.service.tools import make_server

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


def make_app(service: Service) -> FastAPI:
    """Return the application."""
    server: Server[Any]
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
    server = make_server(app)
    # Every POST is answered alone, without sessions or streams; `KnownHosts` has checked it.
    mcp = server.streamable_http_app(
        json_response=True,
        stateless_http=True,
        max_request_body_size=MOST_BYTES,
        transport_security=TransportSecuritySettings(enable_dns_rebinding_protection=False),
    )
    app.router.routes.append(Route("/mcp", EventStreams(mcp), methods=["POST"]))
    app.router.route_class = _ParsedRoute
    app.add_middleware(_Parser)
    app.exception_handler(BSGError)(_explain)
    app.exception_handler(RequestValidationError)(_explain_question)
    app.exception_handler(HTTPException)(_explain_path)
    app.exception_handler(Exception)(_confess)

    for name, question in QUESTIONS.items():
        app.post(f"/{name}", operation_id=name)(_answering(service, name, question))
    return app


def _answering(service: Service, name: str, question: Question) -> Callable[..., Awaitable[Any]]:
    """Return the function of a path; FastAPI reads its name, its docstring and its types."""

    async def answer(asked: Any) -> Any:
        return getattr(service, name)(asked)

    answer.__name__, answer.__doc__ = name, question.what
    answer.__annotations__ = {"asked": question.asks, "return": question.answers}
    return answer


class _Parser:
    """Parses the JSON of a question, within the bounds of all JSON that others write."""

    def __init__(self, app: ASGIApp) -> None:
        self._app = app

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        if scope["type"] != "http":
            await self._app(scope, receive, send)
            return
        message = await receive()
        try:
            scope["document"] = parse_json(message["body"]) if message["body"] else None
        except ValueError as error:
            fault = refuse(400, f"no JSON ({str(error)[:SHOWN]})", code="json-malformed")
            await fault(scope, receive, send)
            return
        left = [message]

        async def replay() -> Message:
            return left.pop() if left else await receive()

        await self._app(scope, replay, send)


class _ParsedRequest(Request):  # type: ignore[misc]
    async def json(self) -> Any:
        return self.scope["document"]


class _ParsedRoute(APIRoute):  # type: ignore[misc]
    def get_route_handler(self) -> Callable[[Request], Awaitable[Response]]:
        handle = super().get_route_handler()

        async def handle_parsed(request: Request) -> Response:
            return await handle(_ParsedRequest(request.scope, request.receive))

        return handle_parsed


async def _explain(_: Request, error: Exception) -> JSONResponse:
    code, where = getattr(error, "code", ""), str(getattr(error, "where", ""))
    return refuse(422, str(error), code=code, where=where)


async def _explain_question(request: Request, error: Exception) -> JSONResponse:
    faults = error.errors()  # type: ignore[attr-defined]
    # A wrong key is named before the key that is missing for it.
    fault = next((one for one in faults if one["type"] == "extra_forbidden"), faults[0])
    where = ".".join(str(part)[:SHOWN] for part in fault["loc"][1:]) or "the question"
    is_whole = len(fault["loc"]) == 1
    said = fault["msg"].removeprefix("Value error, ").removeprefix(f"{where}: ")
    said = "expected a JSON object" if is_whole else said
    if fault["type"] == "too_long":
        most, found = fault["ctx"]["max_length"], fault["ctx"]["actual_length"]
        said = f"expected at most {most}, found {found or 'more'}"
    if fault["type"] == "extra_forbidden":
        keys = QUESTIONS[request.url.path.strip("/")].asks.model_fields
        hint = ask_if_meant(where, keys) or f"known are {', '.join(keys)}"
        said = f"is no key; {hint}"
    return refuse(422, f"{where}: {said}", code="question-malformed", where=where)


async def _explain_path(request: Request, error: Exception) -> JSONResponse:
    status, what = error.status_code, f"{request.method} {request.url.path[:SHOWN]}"  # type: ignore[attr-defined]
    said = f"expected POST /find, /next_place, /expect or /mcp, or GET /openapi.json; found {what}"
    return refuse(status, said, code="path-unknown")


async def _confess(_: Request, __: Exception) -> JSONResponse:
    return confess()
