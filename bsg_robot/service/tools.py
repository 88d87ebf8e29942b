"""The door for agents: tools of the Model Context Protocol (MCP), which ask what HTTP asks."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Awaitable, Callable
from importlib.metadata import version
from typing import Any

import anyio
import mcp_types as types
from mcp.server.lowlevel import Server
from mcp.server.stdio import stdio_server

from bsg_data.errors import DatasetError
from bsg_data.files import encode_json
from bsg_robot.service.pool import Pool
from bsg_robot.service.questions import QUESTIONS, Answer

Answering = Callable[[str, bytes], Awaitable[Answer]]

_INSTRUCTIONS = (
    "Say where things probably are in a building that a robot has partly seen, which room to "
    "search first, and which piece of furniture to look at next. Send the whole map with every "
    "question: nothing is remembered. In the simplest map every room lists the things that were "
    'seen there: {"kitchen": ["sink"], "hall": []}. '
    "Names of rooms are read as their kind (kitchen, bedroom_2). A partial graph can also say what "
    "looks have missed (`looks`), and how sure an object is there (`score`)."
)
_TOOLS = {question.tool: (path, question) for path, question in QUESTIONS.items()}


def make_server(answer: Answering) -> Server[Any]:
    """Return the server of the tools, which gives the JSON of questions to a function."""

    async def list_tools(*_: Any) -> types.ListToolsResult:
        tools = [
            types.Tool(
                name=name,
                description=question.asks.__doc__,
                input_schema=question.asks.model_json_schema(),
                output_schema=question.answers.model_json_schema(mode="serialization"),
                annotations=types.ToolAnnotations(read_only_hint=True, open_world_hint=False),
            )
            for name, (_, question) in _TOOLS.items()
        ]
        return types.ListToolsResult(tools=tools)

    async def call_tool(_: Any, asked: types.CallToolRequestParams) -> types.CallToolResult:
        if asked.name not in _TOOLS:
            return _refuse(f"no tool of this name; known are {', '.join(_TOOLS)}")
        path, _ = _TOOLS[asked.name]
        try:
            question = encode_json(asked.arguments or {}).encode()
        except DatasetError:
            return _refuse("expected JSON, whose numbers are finite; found NaN or infinity")
        status, body = await answer(path, question)
        content = json.loads(body)
        if status != 200:
            return _refuse(f"{content['error']} ({content['code']})")
        text = types.TextContent(type="text", text=body.decode())
        return types.CallToolResult(content=[text], structured_content=content)

    return Server(
        "belief-scene-graphs",
        instructions=_INSTRUCTIONS,
        version=version("belief-scene-graphs"),
        on_list_tools=list_tools,
        on_call_tool=call_tool,
    )


def _refuse(fault: str) -> types.CallToolResult:
    text = types.TextContent(type="text", text=fault)
    return types.CallToolResult(content=[text], is_error=True)


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
