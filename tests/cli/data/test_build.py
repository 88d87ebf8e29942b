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
    assert "skipped scenes: 1, unmapped objects: 66" in result.stdout
    assert "00042-broken00000" in result.stdout
    assert "zzqx thing" in result.stdout
    assert "\x1b" not in result.stdout  # a name cannot write to the terminal


def test_one_source_is_needed() -> None:
    run("build", "--out", "x", code=2)
    run("build", "--out", "x", "--hm3d", "a", "--hm3d-stats", "b", code=2)


def test_a_folder_without_scenes_is_said(tmp_path: Path) -> None:
    result = run("build", "--hm3d", tmp_path, "--out", tmp_path / "d", code=1)
    assert "no scene found" in result.stderr


def _count_reports(partial: Path) -> int:
    return len(list(partial.glob(".build/part-*.json")))


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
    while _count_reports(tmp_path / "out.partial") < 1 and child.poll() is None:
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


TABLE = "scene,room,category\nflat,kitchen,stove\nhouse,bath,toilet\n"


def test_a_source_takes_options_of_its_own(tmp_path: Path) -> None:
    (tmp_path / "objects.csv").write_text(TABLE, "utf-8")
    terms = ("licence=CC-BY-4.0", "homepage=https://example.org/?a=b", "citation=Doe, 2026")
    options = [word for term in terms for word in ("--option", term)]
    result = run(
        *("build", "--source", "table", tmp_path / "objects.csv", *options),
        *("--out", tmp_path / "d", "--workers", "1", "--json"),
    )
    (source,) = json.loads(result.stdout)["sources"]
    assert source["terms"]["licence"] == "CC-BY-4.0"
    assert source["terms"]["homepage"] == "https://example.org/?a=b"


def test_a_table_needs_no_option_and_takes_a_map_of_ones_own(tmp_path: Path) -> None:
    (tmp_path / "objects.csv").write_text(TABLE.replace("stove", "Herd"), "utf-8")
    (tmp_path / "mine.csv").write_text("raw_category,category,class\nHerd,stove,stove\n", "utf-8")
    words = ("build", "--source", "table", tmp_path / "objects.csv", "--out", tmp_path / "d")
    result = run(*words, "--class-map", tmp_path / "mine.csv", "--workers", "1")
    assert "1 in 45 classes" in result.stdout
    assert "toilet" in result.stdout  # is in no row of the map
    assert "matterport" not in (tmp_path / "d" / "README.md").read_text("utf-8").casefold()


@pytest.mark.parametrize(
    ("words", "code", "expected"),
    [
        (("--option", "licence"), 2, "expected NAME=VALUE"),
        (("--option", "licence=MIT", "--option", "licence=MIT"), 2, "licence is there twice"),
        (("--option", "license=MIT"), 1, "did you mean licence?"),
        (("--option", "licence=MIT"), 1, "give licence, homepage and citation"),
    ],
)
def test_options_that_are_none(
    tmp_path: Path, words: tuple[str, ...], code: int, expected: str
) -> None:
    (tmp_path / "objects.csv").write_text(TABLE, "utf-8")
    source = ("--source", "table", tmp_path / "objects.csv", "--out", tmp_path / "d")
    result = run("build", *source, *words, code=code)
    assert expected in result.output
