"""The service as an agent asks it: by the official client, over stdin and stdout, and over HTTP."""

from __future__ import annotations

from typing import Any

import anyio
import pytest
from asked_service import COMMAND
from mcp import Client, StdioServerParameters

SIMPLE = {"kitchen": ["sink", "stove"], "hall": []}


@pytest.fixture(params=[pytest.param("stdio", marks=pytest.mark.heavy), "http"])
def server(request: pytest.FixtureRequest) -> Any:
    if request.param == "http":
        return request.getfixturevalue("address") + "/mcp"
    return StdioServerParameters(command=COMMAND[0], args=[*COMMAND[1:], "--stdio"])


def test_an_agent_finds_the_tools_and_asks_them(server: Any) -> None:
    async def ask() -> None:
        async with Client(server) as client:
            tools = {tool.name: tool for tool in (await client.list_tools()).tools}
            assert set(tools) == {"find_things", "next_place", "expect_things"}
            assert all(tool.description and tool.output_schema for tool in tools.values())

            question = {"map": SIMPLE, "things": ["microwave"], "here": "hall"}
            found = (await client.call_tool("find_things", question)).structured_content
            assert found["go_first"] == "kitchen"
            milk = {"map": {"kitchen": ["counter", "fridge"], "hall": []}, "thing": "milk"}
            go = await client.call_tool("next_place", {**milk, "here": "hall", "at": "", "look": 0})
            assert go.structured_content["piece"] == "fridge 1"
            held = await client.call_tool("expect_things", {"map": SIMPLE, "room": "hall"})
            assert len(held.structured_content["rooms"][0]["expected"]) == 10
            fault = await client.call_tool("next_place", milk)
            assert "here: Field required" in fault.content[0].text
            wrong = {"map": {"kitchen": 5}, "things": ["microwave"]}
            fault = await client.call_tool("find_things", wrong)
            assert fault.is_error
            assert "map: kitchen: expected a JSON list of things, such as" in fault.content[0].text
            for wrong in ({"chance": 2}, {"look": -1}, {"task": "some"}, {"robots": 3}):
                assert (await client.call_tool("find_things", {**question, **wrong})).is_error

    anyio.run(ask)
