"""matplotlib takes no settings from the working folder while a command runs."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

ASK = """
import click, os, sys
from bsg_cli.terminal import Command

@click.command(cls=Command)
def ask():
    import matplotlib
    print(matplotlib.rcParams["font.size"], matplotlib.rcParams["backend"], os.getcwd())

ask()
"""
PLAIN = "import matplotlib, os; print(matplotlib.rcParams['font.size'])"
WORKER = """
import os
from bsg_cli.terminal import Workers, worker_pool

def ask(number):
    import matplotlib
    return matplotlib.rcParams["font.size"]

if __name__ == "__main__":
    with worker_pool(Workers(2)) as pool:
        print(*pool.map(ask, range(2)))
"""


def run(folder: Path, script: str, **variables: str) -> subprocess.CompletedProcess[str]:
    """Run a script in a folder; `variables` are added to the environment."""
    kept = {name: value for name, value in os.environ.items() if not name.startswith("MPL")}
    kept.pop("MATPLOTLIBRC", None)
    (folder.parent / "script.py").write_text(script, "utf-8")
    return subprocess.run(
        [sys.executable, str(folder.parent / "script.py")],
        cwd=folder,
        env={**kept, **variables},
        capture_output=True,
        text=True,
        timeout=60,
    )


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A working folder."""
    (tmp_path / "work").mkdir()
    return tmp_path / "work"


@pytest.mark.slow
def test_a_command_draws_with_the_settings_of_matplotlib(folder: Path) -> None:
    (folder / "matplotlibrc").write_text("font.size: 33\ntext.usetex: True\n", "utf-8")
    home = folder / "home"
    (home / ".config" / "matplotlib").mkdir(parents=True)
    (home / ".config" / "matplotlib" / "matplotlibrc").write_text("font.size: 44\n", "utf-8")
    done = run(folder, ASK, MPLBACKEND="no such thing", HOME=str(home))
    assert done.stderr == ""
    assert done.stdout.split() == ["10.0", "agg", str(folder)]


@pytest.mark.slow
def test_a_command_neither_waits_for_a_pipe_nor_reads_damaged_settings(folder: Path) -> None:
    os.mkfifo(folder / "matplotlibrc")
    assert run(folder, ASK).stdout.split()[0] == "10.0"
    (folder / "matplotlibrc").unlink()
    (folder / "matplotlibrc").write_bytes(b"\xff\xfe")
    assert run(folder, ASK).stdout.split()[0] == "10.0"


@pytest.mark.slow
def test_a_command_draws_with_the_settings_that_the_user_names(folder: Path) -> None:
    (folder / "matplotlibrc").write_text("font.size: 33\n", "utf-8")
    (folder / "mine").write_text("font.size: 22\n", "utf-8")
    assert run(folder, ASK, MATPLOTLIBRC="mine").stdout.split()[0] == "22.0"


@pytest.mark.slow
def test_workers_take_no_settings_from_the_working_folder(folder: Path) -> None:
    (folder / "matplotlibrc").write_text("font.size: 33\n", "utf-8")
    done = run(folder, WORKER, MPLBACKEND="no such thing")
    assert done.stdout.split() == ["10.0", "10.0"], done.stderr


@pytest.mark.slow
def test_a_program_of_the_user_keeps_its_settings(folder: Path) -> None:
    (folder / "matplotlibrc").write_text("font.size: 33\n", "utf-8")
    script = "import bsg_cli.terminal, bsg_data\nfrom bsg_models.rendering import figures\n" + PLAIN
    assert run(folder, script).stdout.split() == ["33.0"]
