from __future__ import annotations

import json
from pathlib import Path

import pytest
from data_commands import run


def test_parts_and_then_the_whole(hm3d_folder: Path, tmp_path: Path) -> None:
    words = ("build", "--hm3d", hm3d_folder, "--out", tmp_path / "out", "--workers", 1)
    first = run(*words, "--parts", "2/2").stdout
    assert first.startswith("part 2 of 2: 0 shards, 0 scenes\n1 shard is still missing")
    refused = run("finalise", tmp_path / "out", code=1)
    assert "1 of 1 shards missing or damaged; run these again by --parts: 1/2" in refused.stderr
    second = json.loads(run(*words, "--parts", "1/2", "--json").stdout)
    assert second == {"part": 1, "of": 2, "shards": [0], "scenes": 12, "missing": []}
    assert "12 scenes" in run("finalise", tmp_path / "out").stdout
    again = run("finalise", tmp_path / "out", code=1)
    assert "is finished already" in again.stderr


@pytest.mark.parametrize("part", ["0/3", "4/3", "3", "a/b", "1/0"])
def test_what_is_no_part_is_refused(hm3d_folder: Path, tmp_path: Path, part: str) -> None:
    words = ("build", "--hm3d", hm3d_folder, "--out", tmp_path / "out", "--parts", part)
    assert "expected I/N" in run(*words, code=2).stderr
