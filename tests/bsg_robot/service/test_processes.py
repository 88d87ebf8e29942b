"""The processes that answer: one that takes too long is killed, and those who wait may leave."""

from __future__ import annotations

import json
import subprocess
import sys
from typing import Any

import anyio
import pytest

from bsg_robot.service.processes import Processes

SIMPLE = {"map": {"kitchen": ["sink", "stove"], "hall": []}, "things": "cup"}
WORDS = {f"room {one}": [f"word {one} {number}" for number in range(40)] for one in range(500)}
THINGS = ["mug", "towel", "banana", "sofa", "toilet", "book", "laptop", "knife", "shampoo", "tv"]
LONG = {"map": WORDS, "things": THINGS}
SCOPE = {
    "method": "POST",
    "path": "/find",
    "query_string": b"",
    "headers": [(b"content-type", b"application/json")],
}


async def ask(processes: Processes, question: Any, *, left_after: float = 600) -> tuple[int, str]:
    """Return status and code of the answer; the client leaves after so many seconds."""

    async def receive() -> dict[str, str]:
        await anyio.sleep(left_after)
        return {"type": "http.disconnect"}

    answer = await processes(SCOPE, json.dumps(question).encode(), receive)
    return answer.status_code, json.loads(answer.body).get("code", "")


def test_a_question_that_takes_too_long_ends_with_its_process(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    async def run() -> None:
        processes = Processes("universal")
        monkeypatch.setattr("bsg_robot.service.processes.SECONDS_TO_ANSWER", 1)
        assert await ask(processes, LONG) == (503, "answer-late")
        monkeypatch.setattr("bsg_robot.service.processes.SECONDS_TO_ANSWER", 60)
        assert await ask(processes, SIMPLE) == (200, "")

    anyio.run(run)


@pytest.mark.heavy
def test_a_service_whose_processes_do_not_start_says_so() -> None:
    late = "import bsg_robot.service.processes as one; one.SECONDS_TO_LOAD = 0.001"
    line = f"{late}; from bsg_cli.serve import main; main()"
    words = [sys.executable, "-c", line, "--port", "0"]
    done = subprocess.run(words, capture_output=True, text=True)
    assert done.returncode == 1
    assert "Error: 0 of" in done.stderr
    assert "listening" not in done.stderr


@pytest.mark.heavy
def test_who_waits_may_leave_and_is_told_that_the_service_ends(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("bsg_robot.service.processes.os.cpu_count", lambda: 2)
    monkeypatch.setattr("bsg_robot.service.processes.SECONDS_TO_ANSWER", 15)
    monkeypatch.setattr("bsg_robot.service.processes.SECONDS_TO_END", 1)
    told: dict[str, tuple[int, str]] = {}

    async def run() -> None:
        processes = Processes("universal")

        async def note(name: str, question: Any, left_after: float = 600) -> None:
            told[name] = await ask(processes, question, left_after=left_after)

        async with anyio.create_task_group() as tasks:
            tasks.start_soon(note, "large", LONG)
            await anyio.sleep(0.1)
            # A second large one leaves the other process to small ones.
            await note("left", LONG, 0.1)
            await note("small", SIMPLE)
            assert "large" not in told  # it is under way
            tasks.start_soon(note, "waits", LONG)
            await anyio.sleep(0.1)
            processes.end()
            with anyio.fail_after(60):
                while "waits" not in told:
                    await anyio.sleep(0.01)
            assert "large" not in told
        assert await ask(processes, SIMPLE) == (503, "service-ending")

    anyio.run(run)
    assert told == {
        "left": (503, "busy"),
        "small": (200, ""),
        "waits": (503, "service-ending"),
        "large": (503, "service-ending"),  # it had its time
    }
