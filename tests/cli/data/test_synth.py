from __future__ import annotations

from pathlib import Path

import pytest
from data_commands import run


def test_buildings_that_are_there_need_force(tmp_path: Path) -> None:
    run("synth", "--out", tmp_path / "b", "--scenes", "2")
    assert "--force" in run("synth", "--out", tmp_path / "b", "--scenes", "2", code=1).stderr
    size = ("--rooms", "5", "--objects", "9")
    run("synth", "--out", tmp_path / "b", "--scenes", "1", *size, "--force")
    assert len(list((tmp_path / "b").rglob("*.semantic.txt"))) == 1


@pytest.mark.parametrize("words", ["--scenes 0", "--size full", "--rooms 5 --objects 4"])
def test_wrong_usage_is_exit_code_2(words: str, tmp_path: Path) -> None:
    run("synth", "--out", tmp_path / "x", *words.split(), code=2)
