"""A name leads to a checkpoint in one order, and to an error that says what there is."""

from __future__ import annotations

import os
import shutil
from pathlib import Path

import pytest

from bsg_models.errors import CheckpointError
from bsg_models.runs.found_model import FoundModel, find_model, locate_run


def test_every_kind_is_found(
    shipped: Path, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    best = Path("run/best.safetensors")
    Path("hub").mkdir()
    shutil.copy(best, "hub/model.safetensors")
    assert find_model("run") == FoundModel(best, "run", "run")
    assert find_model("./run") == find_model(run.relative_to(tmp_path)) == find_model("run")
    assert find_model("run/best.safetensors") == FoundModel(best, "best", "file")
    assert find_model("hub") == FoundModel(Path("hub/model.safetensors"), "hub", "hub folder")
    assert find_model("other") == FoundModel(shipped / "other.safetensors", "other", "shipped")
    assert locate_run("run") == Path("run")
    assert locate_run("other") == shipped / "other.safetensors"


def test_a_shipped_name_comes_before_a_folder_and_a_path_before_both(
    shipped: Path, run: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    shutil.copytree(run, "other")
    assert find_model("other").kind == "shipped"
    assert find_model("./other").kind == "run"
    assert find_model(f"other{os.sep}").kind == "run"
    assert find_model(Path("other")).kind == "run"


@pytest.mark.parametrize(
    ("model", "words"),
    [
        ("universla", "did you mean universal[?] shipped models are universal, other"),
        ("nothing-like-it", "no folder here and no shipped model has this name"),
        (Path("none"), "which `bsg-train` writes"),
        ("empty", "a folder with best.safetensors.*or model.safetensors.*shipped models are"),
        ("empty/mixture", "no such file or folder: expected a run.* or a checkpoint; shipped"),
        ("runs/mixture", "no such file or folder; shipped.* of the hub, .*download runs/mix"),
        ("", "no model ''"),
    ],
)
@pytest.mark.usefixtures("shipped")
def test_what_is_not_there_is_said(
    model: Path | str, words: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("empty").mkdir()
    with pytest.raises(CheckpointError, match=words):
        find_model(model)


@pytest.mark.parametrize("name", ["b/" + "a" * 300, "\0"])
def test_a_name_that_no_file_system_takes_is_no_model(name: str) -> None:
    with pytest.raises(CheckpointError, match=r"no model|no such file"):
        find_model(name)
