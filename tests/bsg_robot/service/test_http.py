"""The service over HTTP, asked as clients ask it: well, badly, slowly, and all at once."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator
from typing import Any
from urllib.parse import urlsplit

import anyio
import httpx2
import jsonschema
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY

from bsg_cli.serve import main as serve
from bsg_robot.service.http import MOST_BYTES, make_app
from bsg_robot.service.questions import Answer

DSG = json.loads((REPOSITORY / "docs/dsg.json").read_text("utf-8"))
SIMPLE = {"kitchen": ["sink", "stove"], "hall": []}
COSTS = [["hall", "kitchen", 3.5], ["kitchen", "hall", 3.5]]
JSON = {"Content-Type": "application/json"}
HUGE = b" " * 64_000_000


def say_in_pieces() -> Iterator[bytes]:
    """A question too large, whose size is not said before."""
    for _ in range(3):
        yield b" " * (MOST_BYTES // 2)


def ask(address: str, path: str = "/find", **question: Any) -> httpx2.Response:
    return httpx2.post(address + path, json=question, timeout=60)


def test_questions_and_answers_are_as_openapi_says(address: str) -> None:
    described = httpx2.get(f"{address}/openapi.json").json()
    find = {"map": SIMPLE, "things": ["bed", "sofa", "banana"], "here": "hall", "costs": COSTS}
    find |= {"budget": 90, "speed": 0.5}
    schemas = {
        "/find": find,
        "/next_place": {"map": SIMPLE, "thing": "bed", "here": "hall", "costs": COSTS, "look": 2},
        "/expect": {"map": SIMPLE, "room": "hall"},
    }
    team = {**find, "robots": {"a": "hall"}, "look": {"hall": 2}, "chance": 0.7, "task": "all"}
    for path, question in [*schemas.items(), ("/find", team)]:
        post = described["paths"][path]["post"]
        answer = ask(address, path, **question)
        assert answer.status_code == 200, answer.text
        fault = ask(address, path, map=5)
        for value, content in (
            (question, post["requestBody"]),
            (answer.json(), post["responses"]["200"]),
            (fault.json(), post["responses"]["422"]),
        ):
            schema = content["content"]["application/json"]["schema"]
            jsonschema.validate(value, {**schema, "components": described["components"]})


FIND = {"map": SIMPLE, "things": "sink"}
PLACE = {"map": SIMPLE, "thing": "sink", "here": "hall"}


@pytest.mark.parametrize(
    ("question", "code", "place"),
    [
        (FIND | {"map": {"kitchen": "sink"}}, "graph-malformed", "map: kitchen: "),
        (FIND | {"map": {**DSG, "nodes": [{}]}}, "dsg-malformed", "map: "),
        (FIND | {"map": {str(n): [] for n in range(501)}}, "rooms-too-many", "map: "),
        (FIND | {"things": "flibber"}, "thing-unknown", "no model here can look for"),
        (FIND | {"heer": "hall"}, "question-malformed", "heer: "),
        (FIND | {"map": "[]"}, "question-malformed", "map: expected a JSON object such as {"),
        (FIND | {"map": '{"a": [], "a": []}'}, "question-malformed", "map: expected a value, or"),
        (FIND | {"look": "much"}, "question-malformed", "look: expected a value, or the text of"),
        (PLACE | {"things": "sink"}, "question-malformed", "things: "),
    ],
)
def test_a_fault_says_where_it_is(
    address: str, question: dict[str, Any], code: str, place: str
) -> None:
    answer = ask(address, "/next_place" if "thing" in question else "/find", **question)
    fault = answer.json()
    assert (answer.status_code, fault["code"]) == (422, code)
    assert fault["error"].startswith(place), fault


@pytest.mark.parametrize(
    ("body", "headers", "status", "code"),
    [
        (b"{", JSON, 400, "json-malformed"),
        (b'{"map": {"hall": ["lamp"], "hall": []}, "things": "lamp"}', JSON, 400, "json-malformed"),
        (b"[" * 100_000, JSON, 400, "json-malformed"),
        (b"{}", {"Content-Type": "text/plain"}, 415, "content-type"),
        (b"[]", JSON, 422, "question-malformed"),
        (HUGE, JSON, 413, "question-too-large"),
        (say_in_pieces(), JSON, 413, "question-too-large"),
    ],
)
def test_what_is_no_question_is_refused(
    address: str, body: bytes | Iterator[bytes], headers: dict[str, str], status: int, code: str
) -> None:
    answer = httpx2.post(f"{address}/find", content=body, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


def ask_app(app: Any, path: str, *, host: str = "localhost") -> tuple[int, str]:
    """Return status and code of the answer of an application in this process."""

    async def post() -> tuple[int, str]:
        transport = httpx2.ASGITransport(app=app, raise_app_exceptions=False)
        async with httpx2.AsyncClient(transport=transport, base_url=f"http://{host}") as client:
            answer = await client.post(path, json={})
        return answer.status_code, answer.json().get("code", "")

    return anyio.run(post)


async def fail(*_: Any) -> Answer:
    raise AssertionError


async def answer_nothing(*_: Any) -> Answer:
    return Answer(200, b"{}")


def test_what_nobody_foresaw_is_answered_as_json() -> None:
    assert ask_app(make_app(fail), "/find") == (500, "service-error")
    assert ask_app(make_app(fail), "/nothing") == (404, "path-unknown")


def test_a_question_whose_client_has_left_holds_no_process() -> None:
    ended = []

    async def answer(*_: Any) -> Answer:
        try:
            await anyio.sleep_forever()
        finally:
            ended.append("the answer")
        raise AssertionError

    messages = [
        {"type": "http.request", "body": b"{}", "more_body": False},
        {"type": "http.disconnect"},
    ]
    headers = [(b"host", b"localhost"), (b"content-type", b"application/json")]
    scope = {"type": "http", "method": "POST", "path": "/find", "query_string": b""}

    async def receive() -> Any:
        return messages.pop(0)

    async def send(_: Any) -> None:
        pass

    async def run() -> None:
        with anyio.fail_after(10):
            await make_app(answer)(scope | {"headers": headers}, receive, send)

    anyio.run(run)
    assert ended == ["the answer"]


BLANK = {"robots": {}, "look": "", "chance": None, "task": "", "labels": None}
BUDGET = FIND | {"here": "hall", "budget": 9, "speed": 0.5}


@pytest.mark.parametrize(
    ("text", "question"),
    [
        (FIND | BLANK | {"here": ""}, FIND),
        (FIND | {"map": json.dumps(SIMPLE)}, FIND),
        (FIND | {"look": "5"}, FIND | {"look": 5}),
        (FIND | {"look": '{"hall": 2}'}, FIND | {"look": {"hall": 2}}),
        (BUDGET | {"budget": "9", "speed": "0.5"}, BUDGET),
        (FIND | {"costs": json.dumps(COSTS)}, FIND | {"costs": COSTS}),
        (FIND | {"robots": '{"a": "hall"}'}, FIND | {"robots": {"a": "hall"}}),
        (FIND | {"things": '["cup", "towel"]'}, FIND | {"things": ["cup", "towel"]}),
        (
            FIND | {"things": "mug (red, old), [towel]"},
            FIND | {"things": ["mug (red, old)", "[towel]"]},
        ),
    ],
)
def test_what_an_agent_writes_as_text_or_leaves_blank_is_read(
    address: str, text: dict[str, Any], question: dict[str, Any]
) -> None:
    answer = ask(address, **text)
    assert answer.status_code == 200, answer.text
    assert answer.json() == ask(address, **question).json()


@pytest.mark.parametrize("path", ["/find", "/mcp", "/openapi.json"])
def test_another_host_is_refused(address: str, path: str) -> None:
    """A page of a stranger's name that leads to this machine (DNS rebinding)."""
    port = urlsplit(address).port
    for host in (f"localhost:{port}", "[::1]"):
        answer = httpx2.post(address + path, json={}, headers={"Host": host})
        assert "host-unknown" not in answer.text
    fault = httpx2.post(address + path, json={}, headers={"Host": "evil.example:1"}).json()
    assert (fault["code"], fault["where"]) == ("host-unknown", "evil.example:1")
    assert "--allow-host" in fault["error"]
    for origin in ("http://evil.example", "null"):
        answer = httpx2.post(address + path, json={}, headers={"Origin": origin})
        assert answer.json()["code"] == "host-unknown"


@pytest.mark.parametrize("name", ["http://robot.local", "*", "", "robot local", "robot.local/x"])
def test_what_no_host_header_can_be_is_refused_at_the_start(name: str) -> None:
    result = CliRunner().invoke(serve, ["--allow-host", name])
    assert result.exit_code == 2
    assert "--allow-host" in result.output


def test_a_name_that_is_allowed_may_be_asked() -> None:
    app = make_app(answer_nothing, hosts=["robot.local"])
    assert ask_app(app, "/find", host="robot.local:80") == (200, "")
    assert ask_app(app, "/find", host="other.local") == (400, "host-unknown")


def test_without_its_packages_the_command_says_how_to_install_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delitem(sys.modules, "bsg_robot.service.http")
    monkeypatch.setitem(sys.modules, "fastapi", None)
    result = CliRunner().invoke(serve)
    assert result.exit_code == 1
    assert "bsg-serve needs fastapi: pip install '.[serve]'" in result.output
