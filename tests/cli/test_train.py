from __future__ import annotations

from contextlib import nullcontext
from pathlib import Path
from typing import Any

import pytest
from click.testing import CliRunner
from commands import runner
from conftest import tomllib

from bsg_cli import models
from bsg_cli.train import main
from bsg_data.results import name_staged

SMALL = ["--set", "model.width=8", "--set", "training.epochs=4", "--set", "training.batch_size=4"]


run = runner(main)


def test_a_run_tells_how_it_was_trained(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = (dataset, "--config", "ceci", "--seed", "7", *SMALL)
    assert "4 epochs in" in run(*words, "--out", out).stdout
    assert "--force replaces it" in run(*words, "--out", out, code=1).stderr
    assert (out / "curve.png").read_bytes().startswith(b"\x89PNG")
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    shown = CliRunner().invoke(models.main, ["show", str(out)]).stdout
    assert "seed 7; to train it again" in shown
    assert "trained" in shown
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    again = tmp_path / "again"
    run(dataset, "--config", out / "config.toml", "--out", again)
    assert (again / "best.safetensors").read_bytes() == before["best.safetensors"]


def test_a_file_is_enough_and_the_command_line_goes_first(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "there").symlink_to(dataset)
    printed = run("--config", "ceci", "--seed", "7", *SMALL, "--print").stdout
    assert tomllib.loads(printed)["seed"] == 7
    file = tmp_path / "elsewhere" / "mine.toml"
    file.parent.mkdir()
    file.write_text(f'dataset = "there"\nout = "mine"\n{printed}', "utf-8")
    assert run("--config", file, "--print").stdout == printed
    assert "next: bsg-evaluate there --model mine" in run("--config", file).stdout
    assert (tmp_path / "mine" / "config.toml").read_text("utf-8") == printed
    run(dataset, "--config", file, "--out", "other")
    again = [(tmp_path / name / "best.safetensors").read_bytes() for name in ("mine", "other")]
    assert again[0] == again[1]
    file.write_text(f"dataset = 3\n{printed}", "utf-8")
    assert "dataset: expected a path in quotes, found 3" in run("--config", file, code=2).stderr


def test_settings_of_fresh_masks_that_fixed_ones_leave_unread_are_noted(
    dataset: Path, tmp_path: Path
) -> None:
    for out, mask, is_noted in (("a", "rooms", True), ("b", "rooms --set data.masks=fresh", False)):
        settings = ("--set", *f"data.mask.strategy={mask}".split())
        done = run(dataset, "--config", "ceci", *SMALL, *settings, "--out", tmp_path / out)
        note = "data.mask and data.fractions are for data.masks=fresh"
        assert (note in done.stderr) == is_noted


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--config", "none.toml", "--print"], 2),
        (["--config", "ceci", "--set", "sed=1", "--print"], 2),
        ([], 2),
        (["--config", "ceci"], 2),
        (["none", "--config", "ceci", "--out", "x"], 1),
    ],
)
def test_what_cannot_be_trained_is_refused(words: list[str], code: int) -> None:
    assert run(*words, code=code).stdout == ""


def test_after_ctrl_c_the_same_command_goes_on(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def stop(report: Any) -> None:
        if report.epoch == 3:
            raise KeyboardInterrupt

    monkeypatch.setattr("bsg_cli.train._bar", lambda config: nullcontext(stop))
    monkeypatch.setattr("bsg_models.training.epochs.SECONDS_BETWEEN_SAVES", 0.0)
    words = (dataset, "--config", "ceci", "--out", tmp_path / "run", *SMALL)
    words += ("--set", "training.validate_every=1")
    partial = name_staged(tmp_path / "run")
    assert f"{partial}: the same command goes on" in run(*words, code=130).stderr
    monkeypatch.undo()
    run(*words)
    assert not partial.exists()
