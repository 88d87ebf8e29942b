from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

import pytest
from conftest import REPOSITORY

pytest.importorskip("atheris", reason="the extra `fuzz` is not installed")
SCRIPT = REPOSITORY / "scripts" / "faults" / "fuzz.py"


@pytest.mark.heavy
def test_a_reader_is_fed_and_the_count_is_kept(tmp_path: Path) -> None:
    options = ["--targets", "annotation", "--runs", "300", "--corpus", str(tmp_path / "fuzz")]
    options += ["--tally", str(tmp_path / "tally.jsonl")]
    done = subprocess.run([sys.executable, SCRIPT, *options], capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    (line,) = (tmp_path / "tally.jsonl").read_text("utf-8").splitlines()
    trial = json.loads(line)
    assert (trial["command"], trial["misses"]) == ("annotation", [])
    assert trial["tried"] == trial["survived"] >= 300
    assert list((tmp_path / "fuzz" / "corpus" / "annotation").iterdir())


def test_an_input_is_replayed(tmp_path: Path) -> None:
    path = tmp_path / "input"
    path.write_bytes(b"HM3D Semantic Annotations\n1,F,")
    command = [sys.executable, SCRIPT, "--child", "annotation", "--replay", str(path)]
    assert subprocess.run(command).returncode == 0
