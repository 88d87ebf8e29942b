from __future__ import annotations

from pathlib import Path

from data_commands import run


def test_buildings_that_are_there_need_force(tmp_path: Path) -> None:
    run("synth", "--out", tmp_path / "b", "--scenes", "2")
    assert "--force" in run("synth", "--out", tmp_path / "b", "--scenes", "2", code=1).stderr
    run("synth", "--out", tmp_path / "b", "--scenes", "1", "--force")
    assert len(list((tmp_path / "b").rglob("*.semantic.txt"))) == 1
