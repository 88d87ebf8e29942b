from __future__ import annotations

import json
from pathlib import Path

import pytest
from conftest import load_script
from tally import Tally


def test_trials_are_kept_and_told(tmp_path: Path) -> None:
    tally = Tally(tmp_path / "tally.jsonl")
    tally(test="killed", command="bsg-data build", tried=3, survived=2, misses=["write 2: | half"])
    tally(test="killed", command="bsg-data build", tried=2, survived=2)
    tally(test="killed", command="bsg-data split", tried=1, survived=1)
    tally(test="flips", command="bsg-data check", tried=1_000, survived=1_000)
    tally(test="flips", command="bsg-models check", tried=0, survived=0)
    tally(test="mutants", command="masks", tried=60, survived=59, misses=["masks.py:3: `a`"])
    report = load_script("faults/report")
    page = tmp_path / "page.md"
    report.main(["--tally", str(tally.path), "--out", str(page)])
    text = page.read_text("utf-8")
    assert "1,005 of 1,006 tries survived. The tests noticed 59 of 60 changes" in text
    assert "| killed | 2 | 6 | 5 |" in text
    assert "| masks | 60 | 59 |" in text
    assert "- mutants, masks: masks.py:3: `a`" in text
    assert "bsg-models check" not in text
    assert "| killed | bsg-data build | 5 | 4 |" in text
    assert "| killed | bsg-data split | 1 | 1 |" in text
    assert "| flips | bsg-data check | 1,000 | 1,000 |" in text
    assert "- killed, bsg-data build: write 2: | half" in text


def test_without_a_file_nothing_is_kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    Tally(None)(test="killed", command="x", tried=1, survived=1)
    assert not list(tmp_path.iterdir())


def test_a_line_that_is_none_is_named(tmp_path: Path) -> None:
    path = tmp_path / "tally.jsonl"
    path.write_text(json.dumps({"test": "killed"}) + "\n", "utf-8")
    report = load_script("faults/report")
    with pytest.raises(SystemExit, match=r"tally\.jsonl, line 1"):
        report.main(["--tally", str(path), "--out", str(tmp_path / "page.md")])
