from __future__ import annotations

import json
from pathlib import Path

import pandas as pd
import pytest
from bsg_cli import train
from bsg_cli.evaluate import SHORT, main
from click.testing import CliRunner, Result

from bsg_models.zoo import BASELINES


def run(*words: str | Path, code: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result


@pytest.fixture
def trained(dataset: Path, tmp_path: Path) -> Path:
    words = ["--config", "ceci-gcn", "--data", str(dataset), "--out", str(tmp_path / "run")]
    words += ["--set", "training.epochs=2", "--set", "model.width=8"]
    assert CliRunner().invoke(train.main, words).exit_code == 0
    return tmp_path / "run"


def test_a_run_beside_the_baselines(dataset: Path, trained: Path) -> None:
    result = run(trained, "--data", dataset, "--resamples", "3")
    header, *lines = result.stdout.splitlines()
    assert header.split() == ["metric", "nodes", "run", *BASELINES]
    assert {line.split()[0] for line in lines[: len(SHORT)]} == set(SHORT)
    assert "run, beside doubling what was seen:" in result.stdout
    report = json.loads((trained / "evaluation" / "evaluation.json").read_text("utf-8"))
    nll = report["metrics"]["rooms/hidden_nll"]
    assert set(nll) == {"run", *BASELINES}
    assert nll["run"]["low"] <= nll["run"]["value"] <= nll["run"]["high"]
    assert report["draws"] == 4
    classes = pd.read_csv(trained / "evaluation" / "classes.csv")
    assert len(classes) == 5 * 2 * 45
    assert len(list((trained / "evaluation").glob("run-*.png"))) == 3


def test_json_all_metrics_and_force(dataset: Path, trained: Path, tmp_path: Path) -> None:
    words = [trained, "--data", dataset, "--resamples", "0", "--out", tmp_path / "e"]
    report = json.loads(run(*words, "--split", "val", "--json").stdout)
    assert report["split"] == "val"
    assert report["metrics"]["rooms/hidden_nll"]["run"]["low"] is None
    assert "--force" in run(*words, code=1).stderr
    everything = run(*words, "--force", "--all-metrics").stdout
    assert "rooms/wasserstein_classes/kurtosis" in everything


def test_what_is_missing_is_said(dataset: Path, tmp_path: Path) -> None:
    assert "no checkpoint there" in run(tmp_path / "none", "--data", dataset, code=1).stderr
    run("--data", dataset, code=2)
