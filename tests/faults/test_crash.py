"""Killed anywhere: at each call that changes a file, then the same command again."""

from __future__ import annotations

from pathlib import PurePosixPath

import pytest
from bench import Bench, is_unfinished
from commands import COMMANDS, Command
from system_calls import CHANGES, Call, Deed, Fault, can_watch
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
    points = whole.points(CHANGES, most=command.most if full else SAMPLED[command.name])
    misses = []
    for at in points:
        deed: Deed = "tear" if at % 2 else "kill"  # half of a block is written, or nothing of it
        misses += bench.strike(command, Fault(deed, at)).finish()
    bench.note(tally, "killed at every change of a file", command, len(points), misses)
    assert misses == []


def test_nothing_is_written_in_place(command: Command, bench: Bench) -> None:
    """What grows has a hidden name, and gets its own by a rename when its bytes are on the disk."""
    unsynced: set[str] = set()
    wrong = []
    for call in bench.unbroken(command).calls:
        if call.kind == "write":
            unsynced.add(call.path)
            if not is_unfinished(call.path):
                wrong.append(f"written in place: {call}")
        elif call.kind == "sync":
            unsynced.discard(call.path)
        elif call.kind == "rename" and call.path in unsynced:
            wrong.append(f"renamed before it was on the disk: {call}")
    assert sorted(set(wrong)) == []


def test_every_name_reaches_the_disk(command: Command, bench: Bench) -> None:
    """When a command says that it is done, a loss of power takes nothing back."""
    unsynced: dict[str, Call] = {}  # folder → the last name in it that may be lost
    wrong = []
    for call in bench.unbroken(command).calls:
        if call.kind == "sync":
            unsynced.pop(call.path, None)
        if call.kind != "rename":
            continue
        moved = [name for name in unsynced if f"{name}/".startswith(f"{call.path}/")]
        if not is_unfinished(call.target):  # else nobody relies on it yet
            wrong += [f"{unsynced.pop(name)}, then {call}" for name in moved if "/." not in name]
        if not PurePosixPath(call.target).name.startswith("."):
            unsynced[PurePosixPath(call.target).parent.as_posix()] = call
    wrong += [str(call) for folder, call in unsynced.items() if not is_unfinished(folder)]
    assert wrong == []
