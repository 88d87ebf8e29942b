"""`bsg-models`: what is shipped, and what a model is."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from commands import runner

from bsg_cli import evaluate, train
from bsg_cli.models import main

call = runner(main)


@pytest.mark.usefixtures("shipped")
def test_models_are_listed_and_shown() -> None:
    listed = call("list")
    assert "12 buildings of synthetic" in listed.stdout
    assert re.search(r"[1-9]\d* kB|\d+\.\d MB", listed.stdout)
    assert "0.0 MB" not in listed.stdout
    rows = json.loads(call("list", "--json").stdout)
    assert [row["name"] for row in rows] == ["universal", "other"]
    shown = call("show", "other")
    assert "## Limits" in shown.stdout
    assert rows[1]["sha256"] in shown.stdout
    assert "gamma-poisson" in shown.stdout


def test_a_run_is_shown_too(run: Path) -> None:
    shown = call("show", run).stdout
    assert "| hm3d | 10 | [LicenseRef-matterport-academic]" in shown
    assert "**The weights are for non-commercial research**" in shown


@pytest.mark.usefixtures("shipped")
@pytest.mark.parametrize(
    ("words", "said"),
    [
        (("show", "othr"), "did you mean other?"),
        (("download", "rooms"), "is no OWNER/NAME"),
        (("show", "owner/rooms"), "bsg-models download owner/rooms"),
    ],
)
def test_what_is_not_there_is_said(words: tuple[str, ...], said: str) -> None:
    assert said in call(*words, code=1).stderr


def test_what_is_sound_what_was_changed_and_what_has_no_seal(run: Path, tmp_path: Path) -> None:
    assert call("verify", run).stdout == f"{run}: sound (3 files)\n"
    best = run / "best.safetensors"
    assert call("verify", best).stdout == f"{best}: sound\n"
    (run / "training.json").write_text("{}")
    (tmp_path / "empty").mkdir()
    paths = (run, tmp_path / "empty", tmp_path / "nothing", run / "training.json")
    said = call("verify", *paths, best, code=1)
    assert said.stderr.count("Error: ") == len(paths)
    assert said.stdout == f"{best}: sound\n"
    best.write_bytes(best.read_bytes()[:-1] + b"x")
    assert "is not the one in SHA256SUMS" in call("verify", best, code=1).stderr


def test_an_evaluation_of_replaced_weights_is_told(
    run: Path, dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """`bsg-train --force` leaves the evaluation of the old weights in the folder of the new run."""
    monkeypatch.setattr("bsg_models.studies.evaluation_report.plot_evaluation", lambda *_, **__: {})
    runner(evaluate.main)(dataset, "--model", run)
    assert "other weights" not in call("show", run).stderr
    train_again = (dataset, "--out", run, "--force", "--config", "doubled")
    assert f"{run / 'evaluation'} measures other weights" in runner(train.main)(*train_again).stderr
    assert "measures other weights" in call("verify", run / "evaluation").stderr
    runner(evaluate.main)(dataset, "--model", run, "--force")
    assert "other weights" not in call("show", run).stderr


def test_a_build_without_models_lists_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bsg_models.runs.found_model.weights_folder", lambda: tmp_path)
    assert "no models are shipped with this build" in call("list").stderr
