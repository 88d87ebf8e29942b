"""The service, asked in this process by HTTP and by MCP."""

from __future__ import annotations

from typing import Any

import anyio


def ask_service(
    service: Any, question: dict[str, Any], *, path: str = "/find", tool: str = "find_things"
) -> dict[str, dict[str, Any]]:
    """Return door → its answer to a question, or the `error` that it says."""
    import httpx2  # after the test found that the extra is there
    from mcp import Client

    from bsg_robot.service.http import make_app
    from bsg_robot.service.tools import make_server

    async def answer(path: str, body: bytes) -> Any:
        return service.answer(path, body)

    async def ask() -> dict[str, dict[str, Any]]:
        transport = httpx2.ASGITransport(app=make_app(answer))
        async with httpx2.AsyncClient(transport=transport, base_url="http://localhost") as client:
            http = await client.post(path, json=question)
        async with Client(make_server(answer)) as agent:
            mcp = await agent.call_tool(tool, question)
        assert (http.status_code != 200) == mcp.is_error, (http.text, mcp.content)
        content = {"error": mcp.content[0].text} if mcp.is_error else dict(mcp.structured_content)
        return {"HTTP": http.json(), "MCP": content}

    doors: dict[str, dict[str, Any]] = anyio.run(ask)
    return doors
