from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest

from bsg_data.errors import DatasetError
from bsg_data.files import hold


def test_one_holder_at_a_time_and_no_trace(tmp_path: Path) -> None:
    folder = tmp_path / "dataset"
    folder.mkdir()
    (tmp_path / "link").symlink_to(folder)
    for name in ("dataset", "link"):
        with hold(tmp_path / name):
            with pytest.raises(DatasetError, match="another command is writing there"):
                hold(folder).__enter__()
            with hold(tmp_path / "another"):
                assert list(folder.iterdir()) == []
    assert sorted(path.name for path in tmp_path.iterdir()) == ["dataset", "link"]


def test_the_lock_of_a_killed_process_is_free(tmp_path: Path) -> None:
    code = (
        "import os, sys; from pathlib import Path; from bsg_data.files import hold\n"
        "with hold(Path(sys.argv[1])): print('held', flush=True); sys.stdin.readline()\n"
    )
    folder = tmp_path / "dataset"
    command = [sys.executable, "-c", code, str(folder)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as other:
        assert other.stdout is not None
        assert other.stdout.readline() == b"held\n"
        with pytest.raises(DatasetError, match="wait until it is done"):
            hold(folder).__enter__()
        other.kill()
    assert (tmp_path / ".dataset.lock").exists()
    with hold(folder):
        pass
    assert not (tmp_path / ".dataset.lock").exists()


def test_what_is_in_the_way_is_named_and_stays(tmp_path: Path) -> None:
    with pytest.raises(DatasetError, match="nowhere: no such folder"):
        hold(tmp_path / "nowhere" / "dataset").__enter__()
    (tmp_path / ".dataset.lock").write_text("mine")
    with hold(tmp_path / "dataset"):
        pass
    if sys.version_info >= (3, 11):  # filelock 4.1, of Python 3.10, empties the file
        assert (tmp_path / ".dataset.lock").read_text() == "mine"
    (tmp_path / ".other.lock").mkdir()
    with pytest.raises(DatasetError, match=r"cannot be locked by .*\.other\.lock"):
        hold(tmp_path / "other").__enter__()
    (tmp_path / ".third.lock").symlink_to(tmp_path / "victim")
    with pytest.raises(DatasetError, match="cannot be locked"):
        hold(tmp_path / "third").__enter__()
    assert not (tmp_path / "victim").exists()
    (tmp_path / "loop").symlink_to("loop")
    with pytest.raises(DatasetError, match="loop: a link on the way leads to itself"):
        hold(tmp_path / "loop").__enter__()
    with pytest.raises(DatasetError, match="nnn: the name is too long; choose a shorter one"):
        hold(tmp_path / ("n" * 250)).__enter__()
