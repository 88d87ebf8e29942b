from __future__ import annotations

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from conftest import write_scene

from bsg_cli.data import main
from bsg_data.checks.dataset import check_dataset


def run(*words: str | Path, code: int = 0) -> Result:
    result = CliRunner().invoke(main, [str(word) for word in words])
    assert result.exit_code == code, result.output
    return result


@pytest.mark.slow
def test_the_thread_from_buildings_to_proof(tmp_path: Path) -> None:
    buildings, out = tmp_path / "buildings", tmp_path / "dataset"
    run("synth", "--out", buildings, "--scenes", "12", "--seed", "3")
    built = json.loads(run("build", "--hm3d", buildings, "--out", out, "--json").stdout)
    assert built["totals"]["scenes"] == 12
    assert built["source"]["kind"] == "synthetic"
    assert run("split", out).stdout == "train 10, val 1, test 1 buildings\n"
    pairs = json.loads(run("pairs", out, "--draws", "3", "--workers", "1", "--json").stdout)
    assert pairs["rows"] == 3 * (12 + built["totals"]["rooms"])
    assert run("check", out).stdout == f"{out}: sound\n"
    assert json.loads(run("check", out, "--json").stdout) == {"sound": True, "faults": []}
    info = json.loads(run("info", out, "--json", "--figure", tmp_path / "c.png").stdout)
    assert info["splits"] == {"train": 10, "val": 1, "test": 1}
    assert sum(row["instances"] for row in info["classes"]) == built["totals"]["classified"]
    assert (tmp_path / "c.png").stat().st_size > 10_000
    assert "pairs: 3 draws of uniform, fraction 0.5" in run("info", out).stdout


def test_losses_are_reported_in_one_table(hm3d_folder: Path, tmp_path: Path) -> None:
    write_scene(hm3d_folder, "00042-broken00000", b"HM3D Semantic Annotations\n1,\x1b[31m\n")
    result = run("build", "--hm3d", hm3d_folder, "--out", tmp_path / "d", "--workers", "1")
    assert "skipped scenes: 1, unmapped objects: 66" in result.stdout
    assert "00042-broken00000" in result.stdout
    assert "zzqx thing" in result.stdout
    assert "\x1b" not in result.stdout  # a name cannot write to the terminal


def test_a_dataset_with_faults_fails_the_check(dataset: Path) -> None:
    (dataset / "splits.parquet").unlink()
    result = run("check", dataset, code=1)
    assert result.stdout == "splits.parquet: is in the manifest but not there\n"
    assert "faults: 1;" in result.stderr


def test_finished_results_need_force(dataset: Path, hm3d_folder: Path, tmp_path: Path) -> None:
    for words in (["split", dataset], ["pairs", dataset]):
        assert "--force" in run(*words, code=1).stderr
    assert "--force" in run("build", "--hm3d", hm3d_folder, "--out", dataset, code=1).stderr
    run("synth", "--out", tmp_path / "b", "--scenes", "2")
    assert "--force" in run("synth", "--out", tmp_path / "b", "--scenes", "2", code=1).stderr
    run("synth", "--out", tmp_path / "b", "--scenes", "1", "--force")
    assert len(list((tmp_path / "b").rglob("*.semantic.txt"))) == 1
    run("split", dataset, "--seed", "1", "--force")


@pytest.mark.parametrize(
    "words",
    [
        ["build", "--out", "x"],
        ["build", "--out", "x", "--hm3d", "a", "--hm3d-stats", "b"],
        ["split", "x", "--official", "--folds", "3"],
        ["pairs", "x", "--fraction", "1.5"],
        ["pairs", "x", "--fraction", "nan"],
        ["synth", "--out", "x", "--scenes", "901"],
        ["pairs", "x", "--mask", "view"],
        ["synth", "--out", "x", "--scenes", "0"],
        ["nothing"],
    ],
)
def test_wrong_usage_is_exit_code_2(words: list[str]) -> None:
    run(*words, code=2)


def test_errors_are_one_line_without_traceback(tmp_path: Path) -> None:
    result = run("info", tmp_path / "none", code=1)
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1
    result = run("build", "--hm3d", tmp_path, "--out", tmp_path / "d", code=1)
    assert "no scene found" in result.stderr


def test_map_shows_names_classes_and_near_misses() -> None:
    assert "→ corrected 'trash can' → class garbage bin" in run("map", "show", "TRASHCAN").stdout
    assert "class none (part of the building)" in run("map", "show", "wall").stdout
    shown = json.loads(run("map", "show", "garbage bin", "--json").stdout)
    assert "trash can" in shown["spellings"]
    assert "nearest: chair" in run("map", "show", "chairr", code=1).stdout
    assert "hm3d45-v1" in run("map", "list").stdout


def test_map_coverage_adds_up(dataset: Path) -> None:
    found = json.loads(run("map", "coverage", dataset, "--json").stdout)
    parts = ("classified", "structure", "nameless", "unmapped", "left_out")
    assert sum(found[part] for part in parts) == found["objects"]


def test_a_reader_that_goes_away_ends_the_command_quietly(dataset: Path) -> None:
    code = "from bsg_cli.data import main; main()"
    child = subprocess.Popen(
        [sys.executable, "-c", code, "info", str(dataset)],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
    )
    assert child.stdout is not None
    child.stdout.close()
    _, errors = child.communicate(timeout=60)
    assert (child.returncode, errors) == (1, b"")


def _count_reports(partial: Path) -> int:
    return len(list(partial.glob(".reports/part-*.json")))


@pytest.mark.slow
@pytest.mark.parametrize("sign", [signal.SIGINT, signal.SIGKILL])
def test_a_build_that_is_stopped_from_outside_resumes(tmp_path: Path, sign: int) -> None:
    """Stop a real process once a shard is done; the same command ends with the same bytes."""
    buildings = tmp_path / "buildings"
    run("synth", "--out", buildings, "--scenes", "120")
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
