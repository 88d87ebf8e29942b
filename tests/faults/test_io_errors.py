"""The disk answers with an error: at each call, at random, once or from there on."""

from __future__ import annotations

import shutil

import pytest
from bench import Bench
from commands import COMMANDS, Command
from fork_server import Chance
from system_calls import CHANGES, Fault, Kind, can_watch
from tally import Tally

pytestmark = pytest.mark.skipif(bool(can_watch()), reason=can_watch())
READS: tuple[Kind, ...] = ("open", "read")
AT_RANDOM = (  # as libfiu names them; of reads and opens, Python's own would fail, too
    *(f"posix/io/rw/{name}" for name in ("write", "pwrite", "writev", "ftruncate")),
    *(f"posix/io/{name}" for name in ("sync/fsync", "dir/rename", "dir/unlink")),
)
SAMPLED = {"build --force": 2, "split": 2, "pairs --force": 2}  # name → errors of a kind, in short


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Try every command in full, and some in short."""
    full = metafunc.config.getoption("--full")
    tried = [command for command in COMMANDS if full or command.name in SAMPLED]
    metafunc.parametrize("command", tried, ids=[command.name for command in tried])


def test_one_change_of_a_file_fails(
    command: Command, bench: Bench, full: bool, tally: Tally
) -> None:
    """It is told, what was there is there still, and the same command ends as an unbroken one."""
    whole = bench.unbroken(command)
    points = whole.points(
        CHANGES, most=command.limit(50) if full else SAMPLED[command.name], seed=2
    )
    misses = []
    for at in points:
        trial = bench.strike(command, Fault("EIO", at))
        trial.find_no_error()
        if trial.ended.code and not command.resumes:
            trial.find_left()
        misses += trial.finish()
    bench.note(tally, "one change of a file fails (EIO)", command, len(points), misses)
    assert misses == []


def test_every_change_fails_from_one_on(
    command: Command, bench: Bench, full: bool, tally: Tally
) -> None:
    """As on a disk that is full or gone: it is told, and nothing half-written is visible."""
    whole = bench.unbroken(command)
    points = whole.points(
        CHANGES, most=command.limit(25) if full else SAMPLED[command.name], seed=3
    )
    misses = []
    for at in points:
        trial = bench.strike(command, Fault("ENOSPC", at, lasting=True))
        trial.find_no_error()
        misses += trial.finish()
    bench.note(tally, "every change fails from one on (ENOSPC)", command, len(points), misses)
    assert misses == []


def test_a_read_fails(command: Command, bench: Bench, full: bool, tally: Tally) -> None:
    """What cannot be read is an error, and never an input that is not there."""
    whole = bench.unbroken(command)
    points = whole.points(READS, most=command.limit(25) if full else SAMPLED[command.name], seed=4)
    misses = []
    for at in points:
        trial = bench.strike(command, Fault("EIO", at, READS))
        trial.find_no_error()
        misses += trial.finish()
    bench.note(tally, "opening or reading a file fails (EIO)", command, len(points), misses)
    assert misses == []


@pytest.mark.skipif(shutil.which("fiu-run") is None, reason="fiu-run is of Debian's fiu-utils")
def test_changes_fail_at_random(command: Command, bench: Bench, full: bool, tally: Tally) -> None:
    """With whatever errno the C library can give: the same, and what it says may be lost, too."""
    if bench.is_heavy(command.words):
        pytest.skip("torch and matplotlib do not start under fiu-run fast enough")
    if "--workers 2" in command.line:
        pytest.skip("pipes to workers would fail, too, which no disk does; their files do not")
    tried = command.limit(20) if full else SAMPLED[command.name]
    misses = []
    for seed in range(tried):
        chance = Chance(AT_RANDOM, (0.5, 0.1, 0.02, 0.005)[seed % 4], seed)
        misses += bench.strike_at_random(command, chance).finish()
    bench.note(tally, "changes of files fail at random (fiu-run)", command, tried, misses)
    assert misses == []
