from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from commands import runner

from bsg_cli.leaderboard import main

COMMON = ("--folds", "3", "--draws", "2", "--workers", "1")


run = runner(main)


def test_a_leaderboard_of_names_and_files(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    plot = "bsg_models.studies.leaderboard_report.plot_leaderboard"
    monkeypatch.setattr(plot, lambda *given, **_: given[2].write_bytes(b""))  # it takes seconds
    small = tmp_path / "small.toml"
    small.write_text('[model]\nfamily = "ceci-sage"\nwidth = 8\n[training]\nepochs = 1\n', "utf-8")
    words = (dataset, *COMMON, "--out", tmp_path / "board")
    result = run(*words, "--models", f"doubled,gamma-poisson,{small}", "--masks", "rooms")
    assert result.stdout.startswith("`rooms` masks:\nmodel")
    report = json.loads((tmp_path / "board" / "leaderboard.json").read_text("utf-8"))
    assert set(report["masks"]["rooms"]) == {"doubled", "gamma-poisson", "small"}
    assert (tmp_path / "board" / "rooms.png").is_file()
    page = (tmp_path / "board" / "leaderboard.html").read_text("utf-8")
    short, every = page.split("<details>")
    for name, one in report["masks"]["rooms"].items():
        assert f">{name}</td>" in short
        assert f">{one['metrics']['rooms/hidden_nll']['value']:.4g}" in short
    assert "rooms/wasserstein_values/kurtosis" in every
    assert short.count("data:image/png;base64,") == 1
    assert "--force replaces it" in run(*words, "--models", "doubled", code=1).stderr
    words = (*words, "--models", "doubled", "--masks", "rooms", "--force", "--seeds", "2")
    assert "by 2 seeds" in run(*words).stderr
    report = json.loads((tmp_path / "board" / "leaderboard.json").read_text("utf-8"))
    assert set(report["masks"]["rooms"]) == {"doubled"}
    assert report["recipe"]["seeds"] == 2
    page = (tmp_path / "board" / "leaderboard.html").read_bytes()
    shutil.rmtree(tmp_path / "board" / "rooms")
    run(*words)
    assert (tmp_path / "board" / "leaderboard.html").read_bytes() == page


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (("--masks", "uniform,walls"), "no mask 'walls'. Known are uniform, rooms, frontier"),
        (("--models", "ceci-sgae"), "did you mean ceci-sage?"),
        (("--models", " ,"), "--models names no model"),
        (("--models", "doubled,doubled"), "names a model twice"),
        (("--masks", ","), "--masks names nothing"),
    ],
)
def test_wrong_usage(dataset: Path, words: tuple[str, ...], message: str) -> None:
    assert message in run(dataset, *COMMON, *words, code=2).stderr
