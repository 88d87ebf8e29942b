"""Not enough memory: a limit on the address space, from nothing on, beyond what imports take."""

from __future__ import annotations

import sys

import pytest
from bench import Bench
from commands import COMMANDS, Command
from tally import Tally

pytestmark = pytest.mark.skipif(sys.platform != "linux", reason="a limit as that of `ulimit -v`")
MEGABYTE = 2**20
SIZES = (0, 1, 2, 4, 8, 12, 16, 24, 32, 48, 64, 96, 128, 192, 256)
SAMPLED = {"build": (4, 24), "pairs --force": (0, 16)}  # name → megabytes, in short


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Try every command in full, and some in short."""
    full = metafunc.config.getoption("--full")
    tried = [command for command in COMMANDS if full or command.name in SAMPLED]
    metafunc.parametrize("command", tried, ids=[command.name for command in tried])


def test_memory_limit(command: Command, bench: Bench, full: bool, tally: Tally) -> None:
    """It is told in a line, and nothing half-written is visible; or the memory was enough."""
    sizes = command.spread(SIZES if full else SAMPLED[command.name])
    bench.warm(command)  # imports are not ours: they fail as they like
    misses = []
    for size in sizes:
        trial = bench.strike(command, None, memory=size * MEGABYTE)
        trial.title = f"{command.name}, {size} MB beyond its imports"
        trial.find_no_error()
        misses += trial.finish()
    bench.note(tally, "memory limit (ulimit -v)", command, len(sizes), misses)
    assert misses == []
