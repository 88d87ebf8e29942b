"""A package is tried out before it gets where it goes; here without the slow installations."""

from __future__ import annotations

from pathlib import Path

import click
import pytest
from click.testing import CliRunner
from conftest import load_script

TRY_OUT = load_script("package/try_out")


@pytest.mark.parametrize("runs", [True, False])
def test_what_does_not_run_gets_nowhere_and_other_files_stay(
    runs: bool, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def build(folder: Path) -> list[Path]:
        (folder / "new.whl").write_text("new")
        return [folder / "new.whl"]

    def try_file(*_: object) -> None:
        if not runs:
            raise click.ClickException("does not run")

    monkeypatch.setattr(TRY_OUT, "build", build)
    monkeypatch.setattr(TRY_OUT, "try_file", try_file)
    (tmp_path / "old.whl").write_text("old")
    done = CliRunner().invoke(TRY_OUT.main, ["--out", str(tmp_path)])
    assert done.exit_code == (not runs)
    there = {path.name: path.read_text("utf-8") for path in tmp_path.iterdir()}
    assert there == {"old.whl": "old"} | ({"new.whl": "new"} if runs else {})


def test_what_is_tried_out_is_the_demo() -> None:
    lines = list(TRY_OUT.demo_lines())
    programs = {line.split()[0] for line in lines}
    assert {"bsg-data", "bsg-train", "bsg-evaluate", "bsg-search"} <= programs
    assert not any("$(" in line for line in lines)
