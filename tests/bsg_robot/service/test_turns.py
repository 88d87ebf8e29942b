"""Whose questions took least is next, and long questions leave a process to short ones."""

from __future__ import annotations

import anyio
import pytest

from bsg_robot.service.turns import Turns


def answer(questions: list[tuple[str, bool]], *, number: int) -> list[int]:
    """Return the questions (client, whether large) in the order in which their turns came."""
    came: list[int] = []

    async def run() -> None:
        turns = Turns(number)

        async def ask(at: int, client: str, is_large: bool) -> None:
            async with turns.take(client, is_large=is_large):
                came.append(at)
                await anyio.sleep(0.002)

        async with anyio.create_task_group() as tasks:
            for at, question in enumerate(questions):
                tasks.start_soon(ask, at, *question)

    anyio.run(run)
    return came


def test_who_asks_one_question_waits_for_one_of_each_other_client() -> None:
    many = [("greedy", False)] * 60
    came = answer([*many, ("robot", False), ("nurse", False)], number=2)
    assert sorted(came) == list(range(62))
    assert {came.index(60), came.index(61)} < set(range(6))


def test_a_client_alone_is_answered_in_its_order() -> None:
    assert answer([("robot", False)] * 9, number=2) == list(range(9))


def test_large_questions_leave_a_process_to_small_ones() -> None:
    assert answer([("a", True), ("a", True), ("b", True), ("a", False)], number=2)[:2] == [0, 3]


def test_whose_questions_took_least_lately_is_next() -> None:
    came: list[str] = []

    async def run() -> None:
        turns = Turns(2)

        async def ask(client: str) -> None:
            async with turns.take(client, is_large=False):
                came.append(client)

        async with turns.take("greedy", is_large=False):
            await anyio.sleep(0.002)
        async with (
            anyio.create_task_group() as tasks,
            turns.take("a", is_large=False),
            turns.take("b", is_large=False),
        ):
            for client in ("greedy", "quick", "greedy"):
                tasks.start_soon(ask, client)
            await anyio.sleep(0.002)
            assert came == []

    anyio.run(run)
    assert came == ["quick", "greedy", "greedy"]


def test_who_asked_what_takes_long_leaves_a_process_to_others_for_a_while(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("bsg_robot.service.turns._LONG", 0.001)

    async def run() -> None:
        turns = Turns(2)
        async with turns.take("slow", is_large=False):
            await anyio.sleep(0.002)
        async with turns.take("slow", is_large=False):
            with anyio.move_on_after(0.01) as waiting:
                async with turns.take("slow", is_large=False):
                    pytest.fail("one process is kept free")
            assert waiting.cancelled_caught
            with anyio.fail_after(1):
                async with turns.take("other", is_large=False):
                    pass

    anyio.run(run)


@pytest.mark.parametrize("is_large", [True, False])
def test_who_leaves_gives_its_turn_up(is_large: bool) -> None:
    async def run() -> None:
        turns = Turns(2)
        async with turns.take("a", is_large=is_large), turns.take("a", is_large=False):
            with anyio.move_on_after(0.01) as waiting:
                async with turns.take("b", is_large=is_large):
                    pytest.fail("no process is free")
            assert waiting.cancelled_caught
        with anyio.fail_after(1):
            async with turns.take("a", is_large=is_large), turns.take("c", is_large=False):
                pass

    anyio.run(run)
