"""Asked to end: Ctrl-C and SIGTERM at calls that change files, then the same command again."""

from __future__ import annotations

import pytest
from bench import Bench
from commands import COMMANDS, Command
from system_calls import CHANGES, Deed, Fault, can_watch
from tally import Tally

pytestmark = pytest.mark.skipif(bool(can_watch()), reason=can_watch())
SAMPLED = {"build": 2, "pairs --force": 3}  # name → signals of each kind, in short
SIGNALS: dict[Deed, int] = {"INT": 130, "TERM": 143}  # → exit code


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Try every command in full, and some in short."""
    full = metafunc.config.getoption("--full")
    tried = [command for command in COMMANDS if full or command.name in SAMPLED]
    metafunc.parametrize("command", tried, ids=[command.name for command in tried])


def test_asked_to_end(command: Command, bench: Bench, full: bool, tally: Tally) -> None:
    """The exit code says by what; nothing is left that the same command does not go on with."""
    whole = bench.unbroken(command)
    misses = []
    points = whole.points(
        CHANGES, most=command.limit(20) if full else SAMPLED[command.name], seed=1
    )
    for deed, code in SIGNALS.items():
        for at in points:
            trial = bench.strike(command, Fault(deed, at))
            if trial.ended.code not in (code, 0):
                trial.wrong.append(f"exit code {trial.ended.code} in place of {code}")
            if not command.resumes and trial.ended.code:
                trial.find_left()
            misses += trial.finish()
    tried = len(points) * len(SIGNALS)
    bench.note(tally, "asked to end (Ctrl-C, SIGTERM)", command, tried, misses)
    assert misses == []
