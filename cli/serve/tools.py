"""The door for agents: tools of the Model Context Protocol (MCP)."""

from __future__ import annotations

from collections.abc import Awaitable
from importlib.metadata import version
from typing import TypeVar

from mcp.server.mcpserver import MCPServer
from mcp.server.mcpserver.exceptions import ToolError
from mcp_types import ToolAnnotations

from bsg_cli.serve.questions import (
    AnyTask,
    Chance,
    Contents,
    Expect,
    Find,
    Found,
    Here,
    Labels,
    Look,
    Map,
    Most,
    Robots,
    Room,
    Service,
    Things,
)
from bsg_data.errors import BSGError

_INSTRUCTIONS = (
    "Say where things probably are in a building that a robot has partly seen, and which room to "
    "search first. Send the whole map with every question: nothing is remembered. In the simplest "
    'map every room lists the things that were seen there: {"kitchen": ["sink"], "hall": []}. '
    "Names of rooms are read as their kind (kitchen, bedroom_2). A partial graph can also say what "
    "looks have missed (`looks`), and how sure an object is there (`score`)."
)
_Answer = TypeVar("_Answer")


def make_server(service: Service) -> MCPServer:
    """Return the server of the two tools."""
    server = MCPServer(
        "belief-scene-graphs",
        instructions=_INSTRUCTIONS,
        version=version("belief-scene-graphs"),
        log_level="WARNING",
    )

    async def find_things(
        map: Map,  # noqa: A002 -- the name that callers write
        things: Things,
        here: Here = None,
        robots: Robots = None,
        look: Look = None,
        chance: Chance = None,
        task: AnyTask = None,
        labels: Labels = None,
    ) -> Found:
        """Say in which rooms things probably are, and which room to search first."""
        asked = Find(
            map=map,
            things=things,
            here=here,
            robots=robots,
            look=look,
            chance=chance,
            task=task,
            labels=labels,
        )
        return await _answer(service.find(asked))

    async def expect_things(
        map: Map,  # noqa: A002
        room: Room = None,
        most: Most = None,
        labels: Labels = None,
    ) -> Contents:
        """Say what rooms probably hold that was not seen yet, of one room or of all."""
        asked = Expect(map=map, room=room, most=most, labels=labels)
        return await _answer(service.expect(asked))

    for tool in (find_things, expect_things):
        reads = ToolAnnotations(read_only_hint=True, open_world_hint=False)
        server.add_tool(tool, annotations=reads)
    return server


async def _answer(coming: Awaitable[_Answer]) -> _Answer:
    try:
        return await coming
    except BSGError as error:
        raise ToolError(f"{error} ({error.code})") from error
