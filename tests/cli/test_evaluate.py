from __future__ import annotations

import json
import re
import shutil
from pathlib import Path

import pandas as pd
import pytest
from click.testing import Result
from commands import runner
from matplotlib.figure import Figure

from bsg_cli import train
from bsg_cli.evaluate import main
from bsg_data.files import FigureError, write_figure
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.seal import read_seal
from bsg_models.evaluation.catalogue import head_value, list_values
from bsg_models.evaluation.verdict import HEADLINES
from bsg_models.zoo.catalogue import BASELINES

run = runner(main)


def train_run(dataset: Path, out: Path) -> Result:
    words = (dataset, "--config", "ceci", "--out", out, "--set", "model.width=8")
    return runner(train.main)(*words, "--set", "training.epochs=2")


@pytest.fixture
def trained(dataset: Path, tmp_path: Path) -> Path:
    train_run(dataset, tmp_path / "run")
    return tmp_path / "run"


def test_a_run_beside_the_baselines(dataset: Path, trained: Path, tmp_path: Path) -> None:
    page = tmp_path / "report.html"
    words = (dataset, "--model", trained, "--html", page, "--mask", "rooms")
    result = run(*words)
    for said in ("measured on 1 building: intervals", "has pairs: their masks are measured"):
        assert said in result.stderr
    assert "is there already; --force replaces it" in run(*words, code=1).stderr
    text = page.read_text("utf-8")
    assert "rooms/wasserstein_values/kurtosis" in text
    assert text.count("data:image/png;base64,") == 3
    assert "Belief scene graph" in text
    assert not re.search(r"(src|href)=.?https?:", text), "it opens offline"
    assert "worse" not in result.stdout
    assert f"ceci {' '.join(BASELINES)}" in " ".join(result.stdout.split())
    for name in (*HEADLINES["what is hidden"], *HEADLINES["whole histograms"]):
        assert head_value(name) in result.stdout
    assert max(map(len, result.stdout.split("\n\n")[0].splitlines())) <= 120
    report = json.loads((trained / "evaluation" / "evaluation.json").read_text("utf-8"))
    nll = report["metrics"]["rooms/hidden_nll"]
    assert set(nll) == {"ceci", *BASELINES}
    assert nll["ceci"]["low"] is nll["ceci"]["high"] is None  # of one building
    assert report["metrics"]["rooms/presence_brier/unvisited"]["ceci"]["value"] is None
    assert tuple(report["metrics"]) == list_values()
    assert report["draws"] == 4
    assert report["runs"]["ceci"]["config"]["model"]["width"] == 8
    assert report["runs"]["ceci"]["folder"] == "run"
    assert report["checkpoints_sha256"] == [hash_file(trained / "best.safetensors")]
    classes = pd.read_csv(trained / "evaluation" / "classes.csv")
    assert len(classes) == 5 * 2 * 45
    assert len(list((trained / "evaluation").glob("ceci-*.png"))) == 3


@pytest.fixture
def no_figures(monkeypatch: pytest.MonkeyPatch) -> None:
    """Leave the figures out, which take most of the time of an evaluation."""
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})


def test_results_are_kept_if_a_figure_cannot_be_drawn(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def fail(figure: Figure, path: Path, **_: object) -> None:
        if "building" not in path.name:
            raise FigureError(f"{path.name}: no LaTeX")
        write_figure(figure, path)

    monkeypatch.setattr("bsg_models.rendering.figures._save", fail)
    done = train_run(dataset, tmp_path / "run")
    assert "note: a figure is missing: curve.png: no LaTeX\n" in done.stderr
    assert "learning curve" not in done.stdout
    assert "best.safetensors" in read_seal(tmp_path / "run")
    result = run(dataset, "--model", tmp_path / "run")
    assert result.stderr.count("note: a figure is missing: ") == 2
    assert "figures beside them: 1\n" in result.stdout
    names = sorted(path.name for path in (tmp_path / "run" / "evaluation").iterdir())
    assert names == ["SHA256SUMS", "ceci-building.png", "classes.csv", "evaluation.json"]


@pytest.mark.usefixtures("no_figures", "shipped")
def test_a_shipped_model_is_measured_by_its_name(
    dataset: Path, trained: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    other = (dataset, "--model", "other")
    named = run(*other, "--model", "run")  # a name, and a folder that is there
    report = json.loads(Path("evaluation/evaluation.json").read_text("utf-8"))
    assert list(report["runs"]) == ["other", "ceci"]
    assert "other" in named.stdout
    shutil.copytree(trained, "other")
    run(*other)  # a folder that is there comes first
    report = json.loads(Path("other/evaluation/evaluation.json").read_text("utf-8"))
    assert report["runs"]["ceci"]["folder"] == "other"
    assert "did you mean other?" in run(dataset, "--model", "othr", "--out", "x", code=1).stderr
