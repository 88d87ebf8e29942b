"""`bsg-models`: what is shipped, and what a model is."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest
from commands import runner

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


def test_a_build_without_models_lists_none(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("bsg_models.runs.found_model.weights_folder", lambda: tmp_path)
    assert "no models are shipped with this build" in call("list").stderr
