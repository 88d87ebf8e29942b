"""The processes that answer: a slow question delays no other, and what was killed is replaced."""

from __future__ import annotations

import json
import os
import signal
import subprocess
from pathlib import Path
from typing import Any

import anyio
import httpx2
import pytest

from bsg_robot.service import pool
from bsg_robot.service.pool import Pool

SIMPLE = {"map": {"kitchen": ["sink", "stove"], "hall": []}, "things": "cup"}
WORDS = {f"room {number}": [f"word {number} {n}" for n in range(40)] for number in range(500)}
THINGS = ["mug", "towel", "banana", "sofa", "toilet", "book", "laptop", "knife", "shampoo", "tv"]
LONG = {"map": WORDS, "things": THINGS}


async def ask(own: Pool, question: Any) -> tuple[int, str]:
    """Return status and code of the answer."""
    status, body = await own.answer("find", json.dumps(question).encode())
    return status, json.loads(body).get("code", "")


def test_a_late_question_delays_no_other_and_its_process_is_replaced(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    answers: list[tuple[int, str]] = []

    async def run() -> None:
        own = Pool("universal")
        await own.start()

        async def ask_long() -> None:
            answers.append(await ask(own, LONG))

        async with anyio.create_task_group() as tasks:
            monkeypatch.setattr(pool, "SECONDS_TO_ANSWER", 3)
            tasks.start_soon(ask_long)
            await anyio.sleep(0.1)
            monkeypatch.setattr(pool, "SECONDS_TO_ANSWER", 60)
            assert await ask(own, SIMPLE) == (200, "")
            assert answers == [], "the long one is under way"
        assert answers == [(503, "answer-late")]
        assert await ask(own, SIMPLE) == (200, "")
        monkeypatch.setattr(pool, "SECONDS_TO_WAIT", 0)
        own._turns = anyio.Semaphore(0)
        assert await ask(own, SIMPLE) == (503, "busy")

    anyio.run(run)


@pytest.mark.heavy
@pytest.mark.skipif(not Path("/proc/self/task").exists(), reason="needs Linux")
def test_killed_processes_are_replaced_and_the_service_ends_in_order(
    own_service: tuple[subprocess.Popen[str], str],
) -> None:
    process, address = own_service
    processes = Path(f"/proc/{process.pid}/task/{process.pid}/children")
    codes: list[str] = []

    async def run() -> None:
        async with httpx2.AsyncClient(base_url=address, timeout=60) as client:

            async def post(question: Any) -> str:
                answer = await client.post("/find", json=question)
                codes.append(answer.json().get("code", "answered"))
                return codes[-1]

            async with anyio.create_task_group() as tasks:
                assert await post(SIMPLE) == "answered"
                tasks.start_soon(post, LONG)
                await anyio.sleep(1)
                for number in processes.read_text().split():
                    os.kill(int(number), signal.SIGKILL)
            assert codes.pop() == "answer-killed"
            assert await post(SIMPLE) == "answered"
            async with anyio.create_task_group() as tasks:
                for _ in range(10):
                    tasks.start_soon(post, LONG)
                await anyio.sleep(1)
                process.terminate()
        assert codes[-1] == "service-ending"
        assert {*codes[-10:]} <= {"answered", "service-ending"}, "what ends within seconds is told"

    anyio.run(run)
