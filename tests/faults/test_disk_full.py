"""A disk that is full: a file system of every size around what a command needs."""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import pytest
from bench import Bench
from commands import COMMANDS, Command
from tally import Tally

STEP = 2**16  # bytes between two sizes, in full
SAMPLED = {"build --force": 2, "pairs --force": 2, "split": 1}  # name → sizes, in short


def pytest_generate_tests(metafunc: pytest.Metafunc) -> None:
    """Try every command in full, and some in short."""
    full = metafunc.config.getoption("--full")
    tried = [command for command in COMMANDS if full or command.name in SAMPLED]
    metafunc.parametrize("command", tried, ids=[command.name for command in tried])


@pytest.fixture(scope="module")
def disk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder on which a disk of any size can be mounted."""
    if sys.platform != "linux" or os.geteuid() != 0:
        pytest.skip("mounting a tmpfs needs Linux and root")
    folder = tmp_path_factory.mktemp("disk")
    try:
        with mounted(folder):
            pass
    except (OSError, subprocess.CalledProcessError) as error:
        pytest.skip(f"a tmpfs cannot be mounted here: {error}")
    return folder


@contextmanager
def mounted(folder: Path) -> Iterator[None]:
    """Mount a file system in memory on a folder."""
    mount = ["mount", "-t", "tmpfs", "-o", "size=64m", "tmpfs", str(folder)]
    subprocess.run(mount, check=True, capture_output=True)
    try:
        yield
    finally:
        subprocess.run(["umount", str(folder)], check=True)


def resize(folder: Path, size: int) -> None:
    """Give a mounted file system another size."""
    mount = ["mount", "-o", f"remount,size={size}", str(folder)]
    subprocess.run(mount, check=True, capture_output=True)


def used(folder: Path) -> int:
    """Return the bytes that a file system holds."""
    found = os.statvfs(folder)
    return (found.f_blocks - found.f_bfree) * found.f_frsize


def test_disk_full(command: Command, bench: Bench, disk: Path, full: bool, tally: Tally) -> None:
    """It is told; what was there is there still; with room, the same command ends as it must."""
    need = measure_need(command, bench, disk)
    step = STEP if full else need // (SAMPLED[command.name] + 1) + 1
    sizes = command.spread(range(0 if full else step, need, step))
    misses = []
    for room in sizes:
        with mounted(disk):
            work = disk / "work"
            bench.lay_out(command, work)
            held = used(disk)
            resize(disk, held + room)
            trial = bench.try_in(work, command)
            trial.title = f"{command.name}, room for {room} bytes"
            trial.find_no_error()
            if trial.ended.code and not command.resumes:
                trial.find_left()
            resize(disk, 2**26)
            misses += trial.finish()
    bench.note(tally, "disk full, every 64 kB up to the need", command, len(sizes), misses)
    assert misses == []


def measure_need(command: Command, bench: Bench, disk: Path) -> int:
    """Return the bytes of room that a command takes at its end, and half as much for its middle."""
    with mounted(disk):
        bench.lay_out(command, disk / "work")
        held = used(disk)
        assert bench.run(command.words, disk / "work").code == 0
        need = used(disk) - held
        shutil.rmtree(disk / "work")
    return max(2 * need, 2 * STEP)
