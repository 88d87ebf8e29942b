"""The service: started as people start it, or asked in this process by HTTP and by MCP."""

from __future__ import annotations

import re
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import anyio

from bsg_models.runs.found_model import TERMS

COMMAND = (sys.executable, "-c", "from bsg_cli.serve import main; main()")


@contextmanager
def start_service() -> Iterator[tuple[subprocess.Popen[str], str]]:
    """Run the service on a free port of this machine; it ends as it should."""
    with subprocess.Popen([*COMMAND, "--port", "0"], stderr=subprocess.PIPE, text=True) as process:
        assert process.stderr
        try:
            assert process.stderr.readline() == f"{TERMS}\n"
            found = re.search(r"http://127\.0\.0\.1:\d+", process.stderr.readline())
            assert found
            yield process, found[0]
        finally:
            process.terminate()
            notes = process.stderr.read()
    assert (process.returncode, notes.strip()) == (143, "asked to end")


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
