"""A package is tried out before it gets where it goes; here without the slow installations."""

from __future__ import annotations

from pathlib import Path
from types import ModuleType

import click
import pytest
from click.testing import CliRunner
from conftest import load_script

NAMES = ["belief_scene_graphs-2.0.0-py3-none-any.whl", "belief_scene_graphs-2.0.0.tar.gz"]


@pytest.fixture
def try_out(monkeypatch: pytest.MonkeyPatch) -> ModuleType:
    """The script, which writes two files in place of building them, and tries none."""
    script = load_script("package/try_out")

    def build(folder: Path) -> list[Path]:
        for name in NAMES:
            (folder / name).write_text("new")
        return [folder / name for name in NAMES]

    monkeypatch.setattr(script, "build", build)
    monkeypatch.setattr(script, "try_file", lambda *words: None)
    return script


def files_of(folder: Path) -> dict[str, str]:
    return {path.name: path.read_text("utf-8") for path in folder.iterdir()}


def test_files_of_other_versions_stay(try_out: ModuleType, tmp_path: Path) -> None:
    (tmp_path / "belief_scene_graphs-1.0.0.tar.gz").write_text("old")
    (tmp_path / NAMES[0]).write_text("an earlier build of this version")
    done = CliRunner().invoke(try_out.main, ["--out", str(tmp_path)])
    assert done.exit_code == 0, done.output
    assert files_of(tmp_path) == {
        **dict.fromkeys(NAMES, "new"),
        "belief_scene_graphs-1.0.0.tar.gz": "old",
    }


def test_a_file_that_does_not_run_gets_nowhere(
    try_out: ModuleType, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(path: Path, *more: object) -> None:
        if path.suffix == ".gz":
            raise click.ClickException("does not run")

    monkeypatch.setattr(try_out, "try_file", refuse)
    (tmp_path / "belief_scene_graphs-1.0.0.tar.gz").write_text("old")
    done = CliRunner().invoke(try_out.main, ["--out", str(tmp_path)])
    assert done.exit_code == 1
    assert files_of(tmp_path) == {"belief_scene_graphs-1.0.0.tar.gz": "old"}


def test_what_is_tried_out_is_the_demo(try_out: ModuleType) -> None:
    lines = list(try_out.demo_lines())
    programs = {line.split()[0] for line in lines}
    assert {"bsg-data", "bsg-train", "bsg-evaluate", "bsg-search"} <= programs
    assert not any("$(" in line for line in lines)
