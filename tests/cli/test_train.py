from __future__ import annotations

import json
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

from bsg_cli.train import main
from bsg_data.results import UNFINISHED, require_seal

SMALL = ["--set", "model.width=8", "--set", "training.epochs=4", "--set", "training.batch_size=4"]


def run(*words: str | Path, code: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result


def test_a_run_from_a_name(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    found = run("--config", "ceci-gcn", "--data", dataset, "--out", out, *SMALL, "--json")
    summary = json.loads(found.stdout)
    assert summary["epochs"] == 4
    assert Path(summary["checkpoint"]).is_file()
    assert (out / "curve.png").read_bytes().startswith(b"\x89PNG")
    words = ("--config", "ceci-gcn", "--data", dataset, "--out", out, *SMALL)
    assert "--resume continues it" in run(*words, code=1).stderr
    assert "4 epochs in" in run(*words, "--force").stdout


def test_print_config_is_what_runs_and_reads_back(dataset: Path, tmp_path: Path) -> None:
    printed = run("--config", "ceci-gcn", "--seed", "7", *SMALL, "--print-config").stdout
    assert tomllib.loads(printed)["seed"] == 7
    file = tmp_path / "mine.toml"
    file.write_text(printed, "utf-8")
    assert run("--config", file, "--print-config").stdout == printed
    run("--config", file, "--data", dataset, "--out", tmp_path / "run")


def test_a_run_tells_how_it_was_trained(dataset: Path, tmp_path: Path) -> None:
    out = tmp_path / "run"
    words = ("--config", "ceci-gcn", "--data", dataset, "--seed", "7", *SMALL)
    run(*words, "--out", out)
    before = {path.name: path.read_bytes() for path in out.iterdir()}
    shown = run("--show", out).stdout
    assert "seed 7; to train it again" in shown
    assert "finished  0 to 4" in shown
    told = json.loads(run("--show", out, "--json").stdout)
    assert told["config"]["seed"] == 7
    assert [line["event"] for line in told["log"]] == ["begun", "ended"]
    assert {path.name: path.read_bytes() for path in out.iterdir()} == before
    again = tmp_path / "again"
    run("--config", out / "config.toml", "--data", dataset, "--out", again)
    assert (again / "last.safetensors").read_bytes() == before["last.safetensors"]
    assert "no run there" in run("--show", tmp_path, code=1).stderr


@pytest.mark.parametrize(
    ("words", "code"),
    [
        (["--config", "none.toml", "--print-config"], 2),
        (["--config", "ceci-gcn", "--set", "sed=1", "--print-config"], 2),
        ([], 2),
        (["--config", "ceci-gcn"], 2),
        (["--config", "ceci-gcn", "--data", "none", "--out", "x"], 1),
    ],
)
def test_what_cannot_be_trained_is_refused(words: list[str], code: int) -> None:
    assert run(*words, code=code).stdout == ""


# What runs in the background of a shell ignores Ctrl-C from its first moment on; this one must not.
CHILD = """
import signal
signal.signal(signal.SIGINT, signal.default_int_handler)
from bsg_cli.train import main
main()
"""


@pytest.mark.heavy
@pytest.mark.parametrize("force", [False, True])
def test_ctrl_c_leaves_a_run_that_resumes_to_the_same_weights(
    force: bool, dataset: Path, tmp_path: Path
) -> None:
    words = ["--config", "ceci-gcn", "--data", str(dataset), *SMALL]
    words += ["--set", "training.epochs=150", "--set", "training.validate_every=5"]
    run(*words, "--out", tmp_path / "whole")
    stopped = tmp_path / "stopped"
    if force:
        run("--config", "train-mean", "--data", dataset, "--out", stopped)
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
    words = ("--data", dataset, "--out", out, "--resume", "--force")
    run("--config", "train-mean", *words)
    again = run("--config", "train-mean", *words)
    assert "is finished already" in again.stderr
    assert "fitted by counting" in again.stdout
    assert "is finished already" not in run("--config", "doubled", *words).stderr
