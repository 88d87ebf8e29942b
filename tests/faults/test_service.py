"""Broken clients of the service: honest questions stay answered, and nothing of a question stays.

With `--full` each kind meets 1,000 honest questions, and 20,000 questions ask strange words.
"""

from __future__ import annotations

import itertools
import json
import socket
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path
from urllib.parse import urlsplit

import httpx2
import pytest
from asked_service import start_service

pytest.importorskip("mcp", reason="needs the extra serve")
pytestmark = pytest.mark.heavy
HONEST = {"map": {"kitchen": ["sink", "stove"], "hall": []}, "things": "microwave", "here": "hall"}
JSON = {"Content-Type": "application/json"}
SIZE = 2_000_000
TELLER = itertools.count()


@pytest.fixture
def service() -> Iterator[tuple[int, str]]:
    """The process and the address of a service."""
    with start_service() as (process, address):
        yield process.pid, address


def send_lists(address: str) -> None:
    """The slowest JSON that the bounds allow."""
    body = b'{"things": "cup", "map": {"hall": [' + b"[]," * (SIZE // 4) + b'"x"]}}'
    assert (
        httpx2.post(f"{address}/find", content=body, headers=JSON, timeout=600).status_code != 200
    )


def send_numbers(address: str) -> None:
    """As many bytes as the bounds allow, as an agent's map in a text."""
    question = {"map": "[" + "1," * (SIZE // 2 - 200) + "1]", "things": "cup"}
    params = {"name": "find_things", "arguments": question}
    call = {"jsonrpc": "2.0", "id": 1, "method": "tools/call", "params": params}
    httpx2.post(f"{address}/mcp", json=call, timeout=600)


def never_read(address: str) -> None:
    """Ask for a large answer, and do not read it."""
    rooms: dict[str, list[str]] = {f"room {number}": [] for number in range(300)}
    body = json.dumps({"map": rooms, "most": 1000}).encode()
    head = b"POST /expect HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    request = head + f"Content-Length: {len(body)}\r\n\r\n".encode() + body
    client = socket.create_connection(("127.0.0.1", urlsplit(address).port or 0), timeout=60)
    client.sendall(2 * request)  # the second answer has to wait for the first
    time.sleep(5)
    client.close()


def leave(address: str) -> None:
    """Ask what takes seconds, and leave."""
    rooms = {f"room {number}": [f"word {number} {n}" for n in range(40)] for number in range(480)}
    body = json.dumps({"map": rooms, "things": "cup"}).encode()
    head = b"POST /find HTTP/1.1\r\nHost: localhost\r\nContent-Type: application/json\r\n"
    client = socket.create_connection(("127.0.0.1", urlsplit(address).port or 0), timeout=60)
    client.sendall(head + f"Content-Length: {len(body)}\r\n\r\n".encode() + body)
    time.sleep(0.5)
    client.close()


BROKEN: tuple[Callable[[str], None], ...] = (send_lists, send_numbers, never_read, leave)


@pytest.mark.parametrize("broken", BROKEN, ids=lambda ask: ask.__name__)
def test_honest_questions_stay_answered(
    broken: Callable[[str], None], service: tuple[int, str], stride: int
) -> None:
    _, address = service
    ended = threading.Event()

    def annoy() -> None:
        while not ended.is_set():
            with suppress(OSError, httpx2.TransportError):
                broken(address)

    alone = httpx2.post(f"{address}/find", json=HONEST, timeout=600).text
    threading.Thread(target=annoy, daemon=True).start()
    answers = []

    def ask() -> None:
        with httpx2.Client(timeout=600) as client:
            for _ in range(100 if stride == 1 else 5):
                answers.append(client.post(f"{address}/find", json=HONEST))

    honest = [threading.Thread(target=ask) for _ in range(10)]
    for thread in honest:
        thread.start()
    for thread in honest:
        thread.join()
    ended.set()
    assert {answer.text for answer in answers} == {alone}
    assert len(answers) == (1000 if stride == 1 else 50)


@pytest.mark.skipif(not Path("/proc/self/statm").exists(), reason="needs Linux")
def test_nothing_of_a_question_stays(service: tuple[int, str], stride: int) -> None:
    """Neither in the process that listens nor in those that answer."""
    number, address = service

    def measure() -> int:
        """Bytes of the process and of its children."""
        children = Path(f"/proc/{number}/task/{number}/children").read_text().split()
        pages = [int(Path(f"/proc/{child}/statm").read_text().split()[1]) for child in children]
        own = int(Path(f"/proc/{number}/statm").read_text().split()[1])
        return (own + sum(pages)) * 4096

    def ask(times: int, words: int) -> None:
        with httpx2.Client(timeout=600) as client:
            for _ in range(times):
                turn = next(TELLER)
                rooms = {"kitchen": [f"thing{turn} {n} {turn * 7}" for n in range(words)]}
                question = {"map": rooms, "things": f"thing{turn} 3"}
                assert client.post(f"{address}/find", json=question).status_code in (200, 422)

    def ask_twice(times: int, words: int) -> None:
        both = [threading.Thread(target=ask, args=(times // 2, words)) for _ in range(2)]
        for thread in both:
            thread.start()
        for thread in both:
            thread.join()

    ask_twice(160, 1_000)  # until the 65,536 words that each of two processes keeps are full
    before = measure()
    ask_twice(20_000 if stride == 1 else 500, 8)
    assert measure() - before < 20_000_000, (before, measure())
