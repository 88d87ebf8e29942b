"""A byte that is flipped anywhere in what we have written is found by whoever reads it."""

from __future__ import annotations

import shutil
from collections.abc import Callable
from pathlib import Path

import pytest
from conftest import REPOSITORY
from flips import find_missed

from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.studies.run_summary import plot_run
from bsg_models.studies.sealed_results import check_results
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config, override, validate_config

FULL, SHORT = 1_000, 40
IN_SHORT = ("gamma-poisson", "ceci-gcn")  # one that counts, and one of a network
OFFICE = REPOSITORY / "docs" / "office.json"
SMALL = {
    "gamma-poisson": (),
    "conditional": (),
    "prior-table": (),
    "mixture": ("model.types=2", "model.iterations=2"),
    "ceci-gcn": ("model.width=4", "training.epochs=1"),
    "ceci-sage": ("model.width=4", "training.epochs=1"),
    "ensemble": ('model.members=["gamma-poisson","mixture"]', "model.calibrate=false"),
}


def train(family: str, dataset: Path, run: Path) -> Path:
    tables = override(find_config(family).model_dump(mode="json"), list(SMALL[family]))
    list(train_run(validate_config(tables, source=family), dataset, run))
    plot_run(run)
    return run


def try_flips(folder: Path, look: Callable[[], bool], *, full: bool, share: int = 1) -> None:
    number = (FULL if full else SHORT) // share
    missed = find_missed(folder, number, look)
    assert not missed


def test_in_a_dataset(dataset: Path, full: bool) -> None:
    assert not check_dataset(dataset)
    try_flips(dataset, lambda: bool(check_dataset(dataset)), full=full)


def test_in_a_manifest_every_command_finds_it(dataset: Path, tmp_path: Path, full: bool) -> None:
    alone = tmp_path / "alone"
    alone.mkdir()
    shutil.copy(dataset / "dataset.json", alone)

    def look() -> bool:
        read_manifest(alone)
        return False

    assert not look()
    assert not find_missed(alone, FULL if full else SHORT, look)


@pytest.mark.parametrize("family", SMALL)
def test_in_a_checkpoint(dataset: Path, tmp_path: Path, family: str, full: bool) -> None:
    if not (full or family in IN_SHORT):
        pytest.skip("families besides these are tried by `make faults`")
    run = train(family, dataset, tmp_path / "trained")
    alone = tmp_path / "alone"
    alone.mkdir()
    path = Path(shutil.copy(run / "best.safetensors", alone))

    def look() -> bool:
        restore_model(path, load_checkpoint(path))
        return False

    assert not look()
    try_flips(alone, look, full=full, share=4)


def test_in_a_run(dataset: Path, tmp_path: Path, full: bool) -> None:
    run = train("ceci-gcn", dataset, tmp_path / "run")
    assert {path.name for path in run.iterdir()} == {
        *("best.safetensors", "last.safetensors", "metrics.csv", "curve.png"),
        *("config.toml", "log.jsonl", "SHA256SUMS"),
    }

    def look() -> bool:
        return not check_results(run)

    assert not look()
    try_flips(run, look, full=full)


def test_in_a_run_of_an_ensemble(dataset: Path, tmp_path: Path, full: bool) -> None:
    run = train("ensemble", dataset, tmp_path / "run")
    sealed = check_results(run)
    for member in ("gamma-poisson", "mixture"):
        assert f"members/{member}/best.safetensors" in sealed

    def look() -> bool:
        return not check_results(run)

    assert not look()
    try_flips(run, look, full=full)
