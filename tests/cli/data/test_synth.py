from __future__ import annotations

from pathlib import Path

import pytest
from data_commands import run


def test_buildings_that_are_there_need_force(tmp_path: Path) -> None:
    run("synth", "--out", tmp_path / "b", "--scenes", "2")
    assert "--force" in run("synth", "--out", tmp_path / "b", "--scenes", "2", code=1).stderr
    run("synth", "--out", tmp_path / "b", "--scenes", "1", "--force")
    assert len(list((tmp_path / "b").rglob("*.semantic.txt"))) == 1


@pytest.mark.parametrize(
    "words", [("--scenes", "10000001"), ("--scenes", "0"), ("--rooms", "0"), ("--size", "full")]
)
def test_wrong_usage_is_exit_code_2(words: tuple[str, str]) -> None:
    run("synth", "--out", "x", *words, code=2)


def test_a_building_of_a_size_that_cannot_be_is_refused(tmp_path: Path) -> None:
    size = ("--rooms", "5", "--objects", "4")
    run("synth", "--out", tmp_path / "b", "--scenes", "1", *size, code=2)
    run("synth", "--out", tmp_path / "b", "--scenes", "1", "--rooms", "5", "--objects", "9")
