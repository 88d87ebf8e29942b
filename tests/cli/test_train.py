from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from conftest import tomllib

from bsg_cli import models
from bsg_cli.train import main
from bsg_data.results import name_staged

SMALL = ["--set", "model.width=8", "--set", "training.epochs=4", "--set", "training.batch_size=4"]


def run(*words: str | Path, code: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result


def test_a_run_from_a_name(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = (dataset, "--config", "ceci-gcn", "--out", out, *SMALL)
    assert "4 epochs in" in run(*words).stdout
    assert (out / "best.safetensors").is_file()
    assert (out / "curve.png").read_bytes().startswith(b"\x89PNG")
    assert "--force replaces it" in run(*words, code=1).stderr
    assert "4 epochs in" in run(*words, "--force").stdout


def test_print_config_is_what_runs_and_reads_back(dataset: Path, tmp_path: Path) -> None:
    printed = run("--config", "ceci-gcn", "--seed", "7", *SMALL, "--print").stdout
    assert tomllib.loads(printed)["seed"] == 7
    file = tmp_path / "mine.toml"
    file.write_text(printed, "utf-8")
    assert run("--config", file, "--print").stdout == printed
    run(dataset, "--config", file, "--out", tmp_path / "run")


def test_a_run_tells_how_it_was_trained(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = (dataset, "--config", "ceci-gcn", "--seed", "7", *SMALL)
    run(*words, "--out", out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    shown = CliRunner().invoke(models.main, ["show", str(out)]).stdout
    assert "seed 7; to train it again" in shown
    assert "trained" in shown
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    again = tmp_path / "again"
    run(dataset, "--config", out / "config.toml", "--out", again)
    assert (again / "best.safetensors").read_bytes() == before["best.safetensors"]


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--config", "none.toml", "--print"], 2),
        (["--config", "ceci-gcn", "--set", "sed=1", "--print"], 2),
        ([], 2),
        (["--config", "ceci-gcn"], 2),
        (["none", "--config", "ceci-gcn", "--out", "x"], 1),
    ],
)
def test_what_cannot_be_trained_is_refused(words: list[str], code: int) -> None:
    assert run(*words, code=code).stdout == ""


# What runs in the background of a shell ignores Ctrl-C from its first moment on; this one must not.
CHILD = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from bsg_cli import models
from bsg_cli.train import main
main()
"""


@pytest.mark.heavy
def test_after_ctrl_c_the_same_command_goes_on_to_the_same_weights(
    dataset: Path, tmp_path: Path
) -> None:
    words = [str(dataset), "--config", "ceci-gcn", *SMALL]
    words += ["--set", "training.epochs=150", "--set", "training.validate_every=5"]
    run(*words, "--out", tmp_path / "whole")
    stopped = tmp_path / "stopped"
    run(dataset, "--config", "train-mean", "--out", stopped)
    words.append("--force")
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, *words, "--out", stopped],
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    partial = name_staged(stopped)
    while not (partial / "network.safetensors").exists() and child.poll() is None:
        time.sleep(0.005)
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=60)
    assert child.returncode == 130
    assert f"{partial}: the same command goes on".encode() in errors
    assert errors.endswith(b"interrupted\n")
    assert not (stopped / "metrics.csv").exists()  # the finished run stays until then
    run(*words, "--out", stopped)
    name = "best.safetensors"
    assert (stopped / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()
    assert not partial.exists()
