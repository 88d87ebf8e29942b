"""`bsg-data build`, `finalise` and `merge`."""

from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from conftest import write_scene
from data_commands import run

from bsg_data.checks.dataset import check_dataset


def test_losses_are_reported_in_one_table(hm3d_folder: Path, tmp_path: Path) -> None:
    write_scene(hm3d_folder, "00042-broken00000", b"HM3D Semantic Annotations\n1,\x1b[31m\n")
    result = run("build", "--hm3d", hm3d_folder, "--out", tmp_path / "d", "--workers", "1")
    assert result.stdout.startswith("12 scenes, 90 rooms, ")
    assert "skipped scenes: 1, unmapped objects: 66" in result.stdout
    assert "00042-broken00000" in result.stdout
    assert "zzqx thing" in result.stdout
    assert "\x1b" not in result.stdout  # a name cannot write to the terminal
    run("build", "--out", "x", code=2)
    run("build", "--out", "x", "--hm3d", "a", "--source", "hm3d-stats", "b", code=2)


@pytest.mark.heavy
@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGKILL])
def test_a_build_that_is_stopped_from_outside_resumes(tmp_path: Path, sign: int) -> None:
    """Stop a real process once a shard is done; the same command ends with the same bytes."""
    buildings = tmp_path / "buildings"
    run("synth", "--out", buildings, "--scenes", "48")
    run("build", "--hm3d", buildings, "--out", tmp_path / "whole", "--workers", "1")
    words = ["build", "--hm3d", str(buildings), "--out", str(tmp_path / "out"), "--workers", "1"]
    child = subprocess.Popen(
        [sys.executable, "-c", "from bsg_cli.data import main; main()", *words],
        stderr=subprocess.PIPE,
        env={**os.environ, "PYTHONUNBUFFERED": "1"},
    )
    while not list(tmp_path.glob("out.partial/.build/part-*.json")) and child.poll() is None:
        time.sleep(0.005)
    child.send_signal(sign)
    _, errors = child.communicate(timeout=60)
    if sign == signal.SIGINT and child.returncode != 0:  # it may have been done before the signal
        assert child.returncode == 130
        assert errors.endswith(b"interrupted\n")
    if child.returncode != 0:
        assert not (tmp_path / "out").exists()
        run(*words)
    for path in sorted((tmp_path / "whole").rglob("*.*")):
        copy = tmp_path / "out" / path.relative_to(tmp_path / "whole")
        assert copy.read_bytes() == path.read_bytes(), path.name
    assert check_dataset(tmp_path / "out") == ()


def test_a_source_takes_options_and_a_map_of_its_own(tmp_path: Path) -> None:
    table = "scene,room,category\nflat,kitchen,Herd\nhouse,bath,toilet\n"
    (tmp_path / "objects.csv").write_text(table, "utf-8")
    (tmp_path / "mine.csv").write_text("raw_category,category,class\nHerd,stove,stove\n", "utf-8")
    words = ("build", "--source", "table", tmp_path / "objects.csv", "--out", tmp_path / "d")
    terms = ("licence=CC-BY-4.0", "homepage=https://example.org/?a=b", "citation=Doe, 2026")
    options = [word for term in terms for word in ("--option", term)]
    one = ("--workers", "1", "--class-map", tmp_path / "mine.csv")
    run(*words, *options, *one)
    (source,) = json.loads(run("info", tmp_path / "d", "--json").stdout)["sources"]
    assert source["terms"]["licence"] == "CC-BY-4.0"
    assert source["terms"]["homepage"] == "https://example.org/?a=b"
    plain = run(*words, *one, "--force").stdout
    assert "1 in 45 classes" in plain
    assert "toilet" in plain  # is in no row of the map
    for wrong in (["licence"], ["licence=MIT", "--option", "licence=MIT"]):
        run(*words, "--option", *wrong, code=2)
    assert "did you mean licence?" in run(*words, "--option", "license=MIT", code=1).stderr


def test_parts_and_then_the_whole(hm3d_folder: Path, tmp_path: Path) -> None:
    words = ("build", "--hm3d", hm3d_folder, "--out", tmp_path / "out", "--workers", 1)
    first = run(*words, "--parts", "2/2").stdout
    assert first.startswith("part 2 of 2: 0 shards, 0 scenes\n1 shard is still missing")
    refused = run("finalise", tmp_path / "out", code=1)
    assert "1 of 1 shards missing or damaged; run these again by --parts: 1/2" in refused.stderr
    second = run(*words, "--parts", "1/2").stdout
    assert second.startswith("part 1 of 2: 1 shard, 12 scenes\nall shards are built")
    assert "12 scenes" in run("finalise", tmp_path / "out").stdout
    assert "is finished already" in run("finalise", tmp_path / "out", code=1).stderr
    for part in ("0/3", "4/3", "3", "a/b"):
        assert "expected I/N" in run(*words, "--parts", part, code=2).stderr


def test_two_datasets_become_one(dataset: Path, tmp_path: Path) -> None:
    run("synth", "--out", tmp_path / "made", "--scenes", "4")
    run("build", "--hm3d", tmp_path / "made", "--out", tmp_path / "synthetic")
    words = ("merge", dataset, tmp_path / "synthetic", "--out", tmp_path / "both")
    result = run(*words)
    assert "16 scenes" in result.stdout
    assert "next: bsg-data split" in result.stdout
    info = json.loads(run("info", tmp_path / "both", "--json").stdout)
    found = {row["source"]: row["buildings"] for row in info["by_source"]}
    assert found == {"hm3d": 12, "synthetic": 4}
    run(*words, code=1)
    run("merge", dataset, "--out", tmp_path / "more", code=2)
