from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from data_commands import run


def test_classes_and_splits_are_counted(dataset: Path, tmp_path: Path) -> None:
    info = json.loads(run("info", dataset, "--json", "--figure", tmp_path / "c.png").stdout)
    assert info["splits"] == {"train": 10, "val": 1, "test": 1}
    assert sum(row["instances"] for row in info["classes"]) == info["totals"]["classified"]
    assert (tmp_path / "c.png").stat().st_size > 10_000
    shown = run("info", dataset).stdout
    assert "pairs: 4 draws of uniform, fraction 0.5" in shown
    assert list(info["masks_sha256"]) == ["test", "train", "val", "all"]
    assert all(found in shown for found in info["masks_sha256"].values())


def test_a_missing_dataset_is_one_line_without_traceback(tmp_path: Path) -> None:
    result = run("info", tmp_path / "none", code=1)
    assert result.stderr.startswith("Error: ")
    assert result.stderr.count("\n") == 1


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


def test_a_figure_replaces_only_a_figure_of_ours(dataset: Path, tmp_path: Path) -> None:
    mine, ours = tmp_path / "thesis.png", tmp_path / "classes.png"
    mine.write_bytes(b"years of work")
    assert (
        "no figure of this program; --force replaces it"
        in run("info", dataset, "--figure", mine, code=1).output
    )
    assert mine.read_bytes() == b"years of work"
    assert (
        "is a folder; name a file in it"
        in run("info", dataset, "--figure", tmp_path, code=1).output
    )
    run("info", dataset, "--figure", ours)
    run("info", dataset, "--figure", ours)
    run("info", dataset, "--figure", mine, "--force")
    names = {"dataset", "thesis.png", "classes.png"}
    assert {path.name for path in tmp_path.iterdir()} == names
