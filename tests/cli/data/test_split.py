from __future__ import annotations

from pathlib import Path

import pytest
from data_commands import run


def test_buildings_are_dealt_to_splits_of_the_working_folder(
    dataset: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(dataset)
    assert "--force" in run("split", ".", code=1).stderr
    assert run("split", ".", "--force").stdout == (
        "train 10, val 1, test 1 buildings\nnext: bsg-data pairs .\n"
    )
    run("pairs", ".", "--draws", "1", "--workers", "1")
    assert run("split", ".", "--folds", "3", "--force").stdout.startswith("fold-0 4, ")
    run("split", ".", "--official", "--folds", "3", code=2)
