"""`bsg-data info` and `check`."""

from __future__ import annotations

import json
import subprocess
import sys
from pathlib import Path

from data_commands import run


def test_classes_and_splits_are_counted(dataset: Path) -> None:
    info = json.loads(run("info", dataset, "--json").stdout)
    assert info["splits"] == {"train": 10, "val": 1, "test": 1}
    assert sum(row["instances"] for row in info["classes"]) == info["totals"]["classified"]
    shown = run("info", dataset).stdout
    assert shown.startswith("12 scenes, 90 rooms, ")
    assert "pairs: 4 draws of uniform, fraction 0.5" in shown
    assert list(info["masks_sha256"]) == ["test", "train", "val", "all"]
    assert all(found in shown for found in info["masks_sha256"].values())


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


def test_a_figure_is_replaced_by_force_alone(dataset: Path, tmp_path: Path) -> None:
    figure = tmp_path / "classes.png"
    figure.write_bytes(b"years of work")
    assert "--force replaces it" in run("info", dataset, "--figure", figure, code=1).stderr
    assert figure.read_bytes() == b"years of work"
    run("info", dataset, "--figure", figure, "--force")
    assert figure.read_bytes().startswith(b"\x89PNG")
    assert "is a folder" in run("info", dataset, "--figure", tmp_path, "--force", code=1).stderr


def test_a_dataset_is_sound_or_has_faults(dataset: Path) -> None:
    assert run("check", dataset).stdout == f"{dataset}: sound\n"
    assert json.loads(run("check", dataset, "--json").stdout) == {"sound": True, "faults": []}
    (split,) = dataset.glob("splits/*")
    split.unlink()
    result = run("check", dataset, code=1)
    assert result.stdout.startswith(f"splits/{split.name}: ")
    assert "faults: 1;" in result.stderr
    (fault,) = json.loads(run("check", dataset, "--json", code=1).stdout)["faults"]
    assert fault["where"] == f"splits/{split.name}"
