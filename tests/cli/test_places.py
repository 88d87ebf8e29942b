"""No command writes into a dataset, or over a file of sealed results, wherever it is told to."""

from __future__ import annotations

import shutil
from pathlib import Path

import pytest
from click.testing import CliRunner, Result
from conftest import REPOSITORY
from killed_process import snapshot

from bsg_cli.registry import COMMANDS
from bsg_data.seal import write_seal

# PLACE is where the command is told to write: a folder, or a file with a suffix.
INTO = (
    "bsg-data synth --scenes 1 --out PLACE",
    "bsg-data build --hm3d hm3d --workers 1 --out PLACE",
    "bsg-data export dataset --to habitat --out PLACE",
    "bsg-data info dataset --figure PLACE.png",
    "bsg-train dataset --config gamma-poisson --out PLACE",
    "bsg-evaluate dataset --model run --out PLACE",
    "bsg-evaluate dataset --model run --out new --html PLACE.html",
    "bsg-evaluate dataset --model run --out new --write-predictions PLACE",
    "bsg-leaderboard dataset --models doubled --folds 3 --workers 1 --out PLACE",
    "bsg-belief home.json --model run --out PLACE.json",
    "bsg-search dataset --model run --workers 1 --out PLACE",
)


@pytest.fixture
def work(
    dataset: Path, run: Path, hm3d_folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Path:
    """The working folder, with all that the lines read, and `other`, a dataset to write into."""
    shutil.copytree(dataset, tmp_path / "other")
    shutil.copy(REPOSITORY / "docs" / "home.json", tmp_path / "home.json")
    monkeypatch.chdir(tmp_path)
    return tmp_path


def invoke(line: str, place: str) -> Result:
    name, *words = line.replace("PLACE", place).split()
    return CliRunner().invoke(COMMANDS[name], words)


@pytest.mark.parametrize("line", INTO)
def test_no_command_writes_into_a_dataset(line: str, work: Path) -> None:
    (work / "link").symlink_to(work / "other" / "objects")
    before = snapshot(work)
    for place in ("other/objects/place", "link/place"):
        done = invoke(line, place)
        assert done.exit_code == 1, done.output
        assert str(work / "other") in done.stderr
        assert snapshot(work) == before


@pytest.mark.parametrize(
    "line", [line for line in INTO if "PLACE." in line and "tables" not in line]
)
def test_no_command_replaces_a_file_of_sealed_results(line: str, work: Path) -> None:
    mine = f"mine{line.rpartition('PLACE')[2]}"
    (work / "run" / mine).write_text("measured")
    write_seal(work / "run", ["best.safetensors", mine])
    before = snapshot(work)
    done = invoke(line if "--figure" in line else f"{line} --force", "run/mine")
    assert done.exit_code == 1, done.output
    assert mine in done.stderr
    assert snapshot(work) == before
