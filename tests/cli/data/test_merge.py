from __future__ import annotations

import json
from pathlib import Path

from conftest import write_twelve
from data_commands import run


def test_two_datasets_become_one(dataset: Path, tmp_path: Path) -> None:
    run("synth", "--out", tmp_path / "made", "--scenes", "4")
    run("build", "--hm3d", tmp_path / "made", "--out", tmp_path / "synthetic")
    result = run("merge", dataset, tmp_path / "synthetic", "--out", tmp_path / "both")
    assert "16 scenes" in result.stdout
    assert "synthetic" in result.stdout
    assert "next: bsg-data split" in result.stderr
    info = json.loads(run("info", tmp_path / "both", "--json").stdout)
    assert {row["source"]: row["buildings"] for row in info["by_source"]} == {
        "hm3d": 12,
        "synthetic": 4,
    }
    run("merge", dataset, tmp_path / "synthetic", "--out", tmp_path / "both", code=1)


def test_one_dataset_is_no_merge(tmp_path: Path) -> None:
    run("build", "--hm3d", write_twelve(tmp_path / "twelve"), "--out", tmp_path / "one")
    result = run("merge", tmp_path / "one", "--out", tmp_path / "both", code=2)
    assert "expected two or more datasets, found 1" in result.stderr
