"""Killed anywhere: at each call that changes a file, then the same command again."""

from __future__ import annotations

import shutil

import pytest
from bench import (
    Bench,
    Unbroken,
    compare,
    find_half_written,
    find_traceback,
    find_unlisted,
    is_unfinished,
    read_tree,
)
from commands import COMMANDS, Command
from system_calls import CHANGES, Fault, can_watch
from tally import Tally

pytestmark = pytest.mark.skipif(bool(can_watch()), reason=can_watch())
SAMPLED = {"synth": 2, "build": 3, "split": 2, "pairs --force": 3}  # name → kills, in short


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Try every command in full, and some in short."""
    full = metafunc.config.getoption("--full")
    tried = [command for command in COMMANDS if full or command.name in SAMPLED]
    metafunc.parametrize("command", tried, ids=[command.name for command in tried])


def test_killed_at_every_change_of_a_file(
    command: Command, bench: Bench, full: bool, tally: Tally
) -> None:
    """Nothing half-written is visible; the same command ends in the bytes of an unbroken run."""
    whole = bench.unbroken(command)
    points = whole.points(CHANGES, most=None if full else SAMPLED[command.name])
    misses = [
        f"{command.name}, killed at call {at}: {fault}"
        for at in points
        for fault in kill_and_repeat(command, bench, whole, at)
    ]
    failed = len({miss.partition(":")[0] for miss in misses})
    tally(
        test="killed at every change of a file",
        command=f"bsg {command.name}",
        tried=len(points),
        survived=len(points) - failed,
        misses=misses,
    )
    assert misses == []


def kill_and_repeat(command: Command, bench: Bench, whole: Unbroken, at: int) -> list[str]:
    """Kill a command at a call, run it again, and return what is wrong."""
    folder = bench.lay_out(command)
    deed = "tear" if at % 2 else "kill"  # half of a block is written, or nothing of it
    struck = bench.run(command.words, folder, Fault(deed, at))
    if not struck.struck:
        return []  # another thread was quicker: the command is through
    wrong = find_half_written(command, whole, read_tree(folder)) + find_unlisted(folder)
    again = bench.run(command.words_again, folder)
    now = compare(command, whole.after, read_tree(folder))
    wrong += find_traceback(again.said)
    if again.code != 0 and now:
        wrong.append(f"again it says {again.said.strip()!r}")
    shutil.rmtree(folder)
    return wrong + now


def test_nothing_is_written_in_place(command: Command, bench: Bench) -> None:
    """What grows has a hidden name, and gets its own by a rename when its bytes are on the disk."""
    unsynced: set[str] = set()
    wrong = []
    for call in bench.unbroken(command).calls:
        if call.kind == "write":
            unsynced.add(call.path)
            if not is_unfinished(call.path) and not call.path.endswith("log.jsonl"):
                wrong.append(f"written in place: {call}")
        elif call.kind == "sync":
            unsynced.discard(call.path)
        elif call.kind == "rename" and call.path in unsynced:
            wrong.append(f"renamed before it was on the disk: {call}")
    assert sorted(set(wrong)) == []
