"""The service over HTTP, asked as clients ask it: well, badly, slowly, and all at once."""

from __future__ import annotations

import json
import socket
import subprocess
import sys
from collections.abc import Callable
from typing import Any
from urllib.parse import urlsplit

import anyio
import httpx2
import jsonschema
import pytest
from click.testing import CliRunner
from conftest import REPOSITORY

import bsg_robot
from bsg_cli.serve import main as serve
from bsg_robot.service.bounds import MOST_BYTES, MOST_HELD, Bounds, refuse
from bsg_robot.service.doors import KnownHosts
from bsg_robot.service.http import make_app

DSG = json.loads((REPOSITORY / "docs/dsg.json").read_text("utf-8"))
SIMPLE = {"kitchen": ["sink", "stove"], "hall": []}
COSTS = [["hall", "kitchen", 3.5], ["kitchen", "hall", 3.5]]
JSON = {"Content-Type": "application/json"}
HUGE = b'{"map": {"kitchen": ["' + b"x" * 64_000_000 + b'"]}, "things": "chair"}'


def ask(address: str, path: str = "/find", **question: Any) -> httpx2.Response:
    return httpx2.post(address + path, json=question, timeout=60)


@pytest.mark.parametrize("said", [DSG, SIMPLE])
def test_every_kind_of_map_is_read_as_open_graph_reads_it(
    address: str, said: dict[str, Any]
) -> None:
    labels = "mpcat40" if said is DSG else None
    seen = bsg_robot.open_graph(said, labels=labels)
    found = ask(address, "/expect", map=said, most=3, labels=labels).json()
    assert [room["room"] for room in found["rooms"]] == list(seen.rooms)
    assert found["notes"] == list(seen.notes)
    for room in found["rooms"]:
        expected = seen.expected(room["room"])[:3]
        assert [one["name"] for one in room["expected"]] == [one.name for one in expected]
        assert [one["probability"] for one in room["expected"]] == pytest.approx(
            [one.probability for one in expected], abs=1e-6
        )


def test_questions_and_answers_are_as_openapi_says(address: str) -> None:
    described = httpx2.get(f"{address}/openapi.json").json()
    said = {"map": SIMPLE, "things": ["bed", "sofa", "banana"], "here": "hall", "costs": COSTS}
    said |= {"budget": 90, "speed": 0.5}
    schemas = {
        "/find": said,
        "/next_place": {"map": SIMPLE, "thing": "bed", "here": "hall", "costs": COSTS, "look": 2},
        "/expect": {"map": SIMPLE, "room": "hall"},
    }
    team = {**said, "robots": {"a": "hall"}, "look": {"hall": 2}, "chance": 0.7, "task": "all"}
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


@pytest.mark.parametrize(
    ("question", "code", "place"),
    [
        ({"map": {"kitchen": "sink"}}, "graph-malformed", "map: kitchen: "),
        ({"map": {**DSG, "nodes": [{}]}}, "dsg-malformed", "map: "),
        ({"map": {str(n): [] for n in range(501)}}, "rooms-too-many", "map: "),
        ({"map": SIMPLE, "labels": "mpcat40"}, "labels-unused", "labels are for Hydra's"),
        ({"map": SIMPLE, "here": "attic"}, "room-unknown", "map: no room 'attic'"),
        ({"map": SIMPLE, "things": "flibber"}, "thing-unknown", "no model here can look for"),
        ({"map": SIMPLE, "heer": "hall"}, "question-malformed", "heer: "),
        ({"map": SIMPLE, "look": -1}, "question-malformed", "look"),
        ({"map": SIMPLE, "chance": 1.5}, "question-malformed", "chance: "),
        ({"map": [SIMPLE]}, "question-malformed", "map: "),
    ],
)
def test_a_fault_says_where_it_is(
    address: str, question: dict[str, Any], code: str, place: str
) -> None:
    answer = ask(address, **{"things": "sink", **question})
    fault = answer.json()
    assert (answer.status_code, fault["code"]) == (422, code)
    assert fault["error"].startswith(place), fault


@pytest.mark.parametrize(
    ("question", "code", "said"),
    [
        ({"here": ""}, "question-malformed", "here: "),
        ({"at": "fridge"}, "piece-unknown", "'fridge': expected the id of an object of the room"),
        ({"chance": 0}, "chance-zero", "chance: expected above 0"),
        ({"things": "sink"}, "question-malformed", "things: is no key; did you mean thing?"),
    ],
)
def test_a_fault_in_the_question_of_a_place_says_where_it_is(
    address: str, question: dict[str, Any], code: str, said: str
) -> None:
    asked = {"map": SIMPLE, "thing": "sink", "here": "hall", **question}
    answer = ask(address, "/next_place", **asked)
    assert (answer.status_code, answer.json()["code"]) == (422, code)
    assert answer.json()["error"].startswith(said), answer.json()


@pytest.mark.parametrize(
    ("body", "headers", "status", "code"),
    [
        (b"{", JSON, 400, "json-malformed"),
        (b'{"map": {"hall": ["lamp"], "hall": []}, "things": "lamp"}', JSON, 400, "json-malformed"),
        (b"[" * 100_000, JSON, 400, "json-malformed"),
        (b"{}", {"Content-Type": "text/plain"}, 415, "content-type"),
        (HUGE, JSON, 413, "question-too-large"),
    ],
)
def test_what_is_no_question_is_refused(
    address: str, body: bytes, headers: dict[str, str], status: int, code: str
) -> None:
    answer = httpx2.post(f"{address}/find", content=body, headers=headers)
    assert (answer.status_code, answer.json()["code"]) == (status, code)


def test_what_nobody_foresaw_is_answered_as_json() -> None:
    app = make_app(None)  # type: ignore[arg-type] -- which fails when it is asked

    async def ask_it(path: str) -> tuple[int, str]:
        transport = httpx2.ASGITransport(app=app, raise_app_exceptions=False)
        async with httpx2.AsyncClient(transport=transport, base_url="http://localhost") as client:
            answer = await client.post(path, json={"map": SIMPLE, "things": "sink"})
        return answer.status_code, answer.json()["code"]

    assert anyio.run(ask_it, "/find") == (500, "service-error")
    assert anyio.run(ask_it, "/nothing") == (404, "path-unknown")


def test_what_an_agent_fills_in_with_nothing_is_left_out(address: str) -> None:
    plain = ask(address, map=SIMPLE, things="cup", here="hall").json()
    blank = {"robots": {}, "look": "", "chance": None, "task": "", "labels": None}
    assert ask(address, map=SIMPLE, things="cup", here="hall", **blank).json() == plain
    nowhere = ask(address, map=SIMPLE, things="cup", here="").json()
    assert nowhere == ask(address, map=SIMPLE, things="cup").json()
    room = ask(address, "/expect", map=SIMPLE, room="", most=None).json()
    assert room == ask(address, "/expect", map=SIMPLE).json()


@pytest.mark.parametrize("path", ["/find", "/mcp", "/openapi.json"])
def test_another_host_is_refused(address: str, path: str) -> None:
    """A page of a stranger's name that leads to this machine (DNS rebinding)."""
    port = urlsplit(address).port
    for host, refused in (("evil.example", True), (f"localhost:{port}", False), ("[::1]", False)):
        answer = httpx2.post(address + path, json={}, headers={"Host": host})
        assert ("host-unknown" in answer.text) == refused
    fault = httpx2.post(address + path, json={}, headers={"Host": "evil.example:1"}).json()
    assert (fault["code"], fault["where"]) == ("host-unknown", "evil.example:1")
    assert "--allow-host" in fault["error"]
    for origin in ("http://evil.example", "null"):
        answer = httpx2.post(address + path, json={}, headers={"Origin": origin})
        assert answer.json()["code"] == "host-unknown"


@pytest.mark.parametrize("said", ["http://robot.local", "*", "", "robot local", "robot.local/x"])
def test_what_no_host_header_can_be_is_refused_at_the_start(said: str) -> None:
    result = CliRunner().invoke(serve, ["--allow-host", said])
    assert result.exit_code == 2
    assert "--allow-host" in result.output


def test_a_client_that_takes_only_events_gets_one(address: str) -> None:
    question = {"jsonrpc": "2.0", "id": 1, "method": "ping"}
    headers = {"Accept": "text/event-stream"}
    answer = httpx2.post(address + "/mcp", json=question, headers=headers)
    assert answer.headers["content-type"] == "text/event-stream"
    data = answer.text.partition("data: ")[2]
    assert json.loads(data)["id"] == 1


def test_a_name_that_is_allowed_may_be_asked() -> None:
    app = KnownHosts(make_app(None), hosts=["robot.local"])  # type: ignore[arg-type]

    async def status(host: str) -> int:
        transport = httpx2.ASGITransport(app=app)
        async with httpx2.AsyncClient(transport=transport, base_url=f"http://{host}") as client:
            return (await client.get("/openapi.json")).status_code

    assert [anyio.run(status, host) for host in ("robot.local:80", "other.local")] == [200, 400]


def test_without_its_packages_the_command_says_how_to_install_them(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.delitem(sys.modules, "bsg_robot.service.http")
    monkeypatch.setitem(sys.modules, "fastapi", None)
    result = CliRunner().invoke(serve)
    assert result.exit_code == 1
    assert "bsg-serve needs fastapi: pip install '.[serve]'" in result.output


@pytest.mark.heavy
def test_a_service_that_is_asked_to_end_refuses_what_waits(
    own_service: tuple[subprocess.Popen[str], str],
) -> None:
    """What is under way is answered; who waits, or still asks, is told so at once."""
    process, address = own_service
    half = _open_slowly(address)
    rooms = {f"room {number}": [f"thing {one}" for one in range(8)] for number in range(30)}
    question = {"map": rooms, "things": "mug", "here": "room 1"}

    async def ask_all() -> list[httpx2.Response]:
        answers: list[httpx2.Response] = []
        limits = httpx2.Limits(max_connections=100)
        async with (
            httpx2.AsyncClient(base_url=address, limits=limits, timeout=60) as client,
            anyio.create_task_group() as tasks,
        ):

            async def post() -> None:
                answers.append(await client.post("/find", json=question))
                process.terminate()  # with the first answer

            for _ in range(100):
                tasks.start_soon(post)
        return answers

    answers = anyio.run(ask_all)
    refused = [one.json()["code"] for one in answers if one.status_code != 200]
    assert len(answers) == 100
    assert refused == ["service-ending"] * len(refused)
    assert 0 < len(refused) < 100
    assert b"service-ending" in half.recv(1_000)
    half.close()


def _open_slowly(address: str) -> socket.socket:
    """Begin a question, and leave it there."""
    client = socket.create_connection(("127.0.0.1", urlsplit(address).port or 0))
    client.sendall(b"POST /find HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n")
    client.sendall(b"Content-Length: 100\r\n\r\n{")
    return client


async def _answer_nothing(*_: Any) -> Any:
    raise AssertionError


async def _send_slowly() -> dict[str, Any]:
    await anyio.sleep(0.01)
    return {"type": "http.request", "body": b" ", "more_body": True}


def say(*messages: dict[str, Any]) -> Callable[[], Any]:
    """Return what a server receives of a client that says this, and then waits."""
    left = iter(messages)

    async def receive() -> dict[str, Any]:
        for message in left:
            return message
        await anyio.sleep_forever()
        raise AssertionError

    return receive


QUESTION = {"type": "http.request", "body": b"{}", "more_body": False}


def run_bounds(bounds: Bounds, receive: Callable[[], Any]) -> tuple[int, str]:
    """Return status and code of what is answered to a request."""
    sent: list[dict[str, Any]] = []

    async def send(message: dict[str, Any]) -> None:
        sent.append(message)

    headers = [(b"content-type", b"application/json")]
    scope = {"type": "http", "method": "POST", "headers": headers}
    anyio.run(bounds, scope, receive, send)
    return sent[0]["status"], json.loads(sent[1]["body"])["code"]


def test_a_slow_question_ends(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bsg_robot.service.bounds.SECONDS_TO_ASK", 0.1)
    assert run_bounds(Bounds(_answer_nothing), _send_slowly) == (408, "question-slow")
    half = {"type": "http.request", "body": b"{", "more_body": True}
    gone = say(half, {"type": "http.disconnect"})
    assert run_bounds(Bounds(_answer_nothing), gone) == (408, "question-slow")  # nobody hears it


def test_all_questions_together_have_a_bound(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bsg_robot.service.bounds.MOST_HELD", 1)
    assert MOST_BYTES < MOST_HELD
    assert run_bounds(Bounds(_answer_nothing), say(QUESTION)) == (503, "busy")


class Asking:
    """Clients of one service that say their pieces and then wait, and what each was told."""

    def __init__(self, bounds: Bounds) -> None:
        self._bounds, self.told = bounds, dict[str, str]()

    async def ask(self, name: str, address: str, *pieces: bytes, is_whole: bool = False) -> None:
        """Ask, and note the code of the answer."""
        sent: list[dict[str, Any]] = []

        async def send(message: dict[str, Any]) -> None:
            sent.append(message)

        said = [{"type": "http.request", "body": one, "more_body": True} for one in pieces]
        said[-1]["more_body"] = not is_whole
        headers = [(b"content-type", b"application/json")]
        scope = {"type": "http", "method": "POST", "headers": headers, "client": (address, 1)}
        await self._bounds(scope, say(*said), send)  # type: ignore[arg-type]
        self.told[name] = json.loads(sent[1]["body"])["code"]


async def _wait_long(_: Any, body: bytes, receive: Callable[[], Any]) -> Any:
    """Answer small questions at once; large ones wait for a process until they must go."""
    if len(body) > 10:
        await receive()
    return refuse(200, "", code="late" if len(body) > 10 else "answered")


@pytest.mark.parametrize("is_whole", [True, False])
def test_the_client_whose_questions_hold_most_gives_way(
    is_whole: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("bsg_robot.service.bounds.MOST_HELD", 100)

    async def run() -> None:
        asking = Asking(Bounds(_wait_long))
        async with anyio.create_task_group() as tasks:

            def start(*question: Any) -> None:
                tasks.start_soon(lambda: asking.ask(*question, is_whole=is_whole))

            start("other", "127.0.0.4", b" " * 30)
            for name in ("first", "second"):
                start(name, "127.0.0.3", b" " * 10, b" " * 24)
            await anyio.sleep(0.01)
            assert asking.told == {}, "all is within the bound"
            await asking.ask("honest", "127.0.0.1", b" " * 5, is_whole=True)
            await anyio.sleep(0.01)
            assert asking.told == {"honest": "answered", "second": "late" if is_whole else "busy"}
            await asking.ask("third", "127.0.0.3", b" " * 99, is_whole=True)
            assert asking.told["third"] == "busy", "it would hold most itself"
            tasks.cancel_scope.cancel()

    anyio.run(run)


def test_a_question_that_still_comes_is_refused_when_the_service_ends() -> None:
    async def run() -> dict[str, str]:
        bounds = Bounds(_wait_long)
        asking = Asking(bounds)
        async with anyio.create_task_group() as tasks:
            tasks.start_soon(asking.ask, "half", "127.0.0.3", b" ")
            await anyio.sleep(0.01)
            bounds.end()
        await asking.ask("next", "127.0.0.3", b" ")
        return asking.told

    assert anyio.run(run) == {"half": "service-ending", "next": "service-ending"}
