"""What hangs is killed, and told: a suite of faults that waits for ever proves nothing."""

from __future__ import annotations

import time
from pathlib import Path

import pytest
from fork_server import ForkServer, HangError
from system_calls import Fault, can_watch

pytestmark = pytest.mark.skipif(bool(can_watch()), reason=can_watch())
COMMANDS = """
import os, signal, sys, time, types

def add(name, main):
    sys.modules[f"bsg_cli.{name}"] = types.SimpleNamespace(main=main)

add("sleep", lambda: time.sleep(600))
add("pass", lambda: None)
add("stop", lambda: os.kill(os.getppid(), signal.SIGSTOP))
"""


@pytest.fixture(autouse=True)
def modules(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Modules that a server can import: one that has commands, and one that never ends."""
    (tmp_path / "made_commands.py").write_text(COMMANDS)
    (tmp_path / "endless.py").write_text("import time\ntime.sleep(600)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))


def test_imports_that_hang_are_an_error_and_no_trial() -> None:
    began = time.monotonic()
    with pytest.raises(HangError, match="'endless'"):
        ForkServer(("endless",), seconds=0.5, seconds_beside=0.5)
    assert time.monotonic() - began < 30


@pytest.mark.parametrize("fault", [None, Fault()])
def test_a_command_that_hangs_is_killed_and_told(tmp_path: Path, fault: Fault | None) -> None:
    server = ForkServer(("made_commands",), seconds=1)
    try:
        assert server.run(["bsg-sleep"], tmp_path, fault).code is None
        assert server.run(["bsg-pass"], tmp_path, fault).code == 0
    finally:
        server.close()


@pytest.mark.slow
def test_a_server_that_hangs_is_replaced(tmp_path: Path) -> None:
    server = ForkServer(("made_commands",), seconds=2, seconds_beside=5)
    try:
        assert server.run(["bsg-stop"], tmp_path).code is None
        assert server.run(["bsg-pass"], tmp_path).code == 0
    finally:
        server.close()
