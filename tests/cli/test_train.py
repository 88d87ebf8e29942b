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
from safetensors.torch import load_file

from bsg_cli import models
from bsg_cli.train import main
from bsg_data.results import UNFINISHED, require_seal

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
    assert "--resume continues it" in run(*words, code=1).stderr
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
    assert "finished  0 to 4" in shown
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    again = tmp_path / "again"
    run(dataset, "--config", out / "config.toml", "--out", again)
    assert (again / "last.safetensors").read_bytes() == before["last.safetensors"]
    for name in ("best.safetensors", "SHA256SUMS"):  # as if it was killed before it saved anything
        (again / name).unlink()
    assert "finished  0 to 4" in CliRunner().invoke(models.main, ["show", str(again)]).stdout


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
@pytest.mark.parametrize("force", [False, True])
def test_ctrl_c_leaves_a_run_that_resumes_to_the_same_weights(
    force: bool, dataset: Path, tmp_path: Path
) -> None:
    words = [str(dataset), "--config", "ceci-gcn", *SMALL]
    words += ["--set", "training.epochs=150", "--set", "training.validate_every=5"]
    run(*words, "--out", tmp_path / "whole")
    stopped = tmp_path / "stopped"
    if force:
        run(dataset, "--config", "train-mean", "--out", stopped)
        words.append("--force")
    child = subprocess.Popen(
        [sys.executable, "-c", CHILD, *words, "--out", stopped],
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    place = stopped / UNFINISHED if force else stopped  # a finished run stays until then
    while not (place / "last.safetensors").exists() and child.poll() is None:
        time.sleep(0.005)
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=60)
    assert child.returncode == 130
    assert b"--resume goes on" in errors
    assert errors.endswith(b"interrupted\n")
    assert force == (require_seal(stopped) is not None)
    run(*words, "--out", stopped, "--resume")
    for name in ("last.safetensors", "best.safetensors"):
        a, b = load_file(tmp_path / "whole" / name), load_file(stopped / name)
        assert a.keys() == b.keys()
        assert all(a[key].equal(b[key]) for key in a)


def test_only_a_run_that_stays_as_it_is_is_finished_already(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = (dataset, "--out", out, "--resume", "--force")
    run(*words, "--config", "train-mean")
    again = run(*words, "--config", "train-mean")
    assert "is finished already" in again.stderr
    assert "fitted by counting" in again.stdout
    assert "is finished already" not in run(*words, "--config", "doubled").stderr
