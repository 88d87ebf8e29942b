from __future__ import annotations

from pathlib import Path

import pytest
from data_commands import run


def test_buildings_are_dealt_to_three_splits(dataset: Path) -> None:
    assert "--force" in run("split", dataset, code=1).stderr
    assert run("split", dataset, "--force").stdout == "train 10, val 1, test 1 buildings\n"
    assert run("split", dataset, "--folds", "3", "--force").stdout.startswith("fold-0 4, ")


def test_recipes_exclude_each_other(dataset: Path) -> None:
    run("split", dataset, "--official", "--folds", "3", code=2)


def test_the_dataset_may_be_the_working_folder(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(dataset)
    assert "train 10" in run("split", ".", "--force").stdout
    run("pairs", ".", "--draws", "1", "--force")
