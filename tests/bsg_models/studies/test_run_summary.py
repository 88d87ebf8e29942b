from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.errors import DatasetError
from bsg_data.results import SEAL
from bsg_models.errors import CheckpointError, TrainingError
from bsg_models.runs.run_folder import CONFIG, LOG
from bsg_models.studies.run_summary import plot_run, summarise_run
from bsg_models.zoo.config import find_config, write_toml


def write_config(run: Path, name: str) -> None:
    (run / CONFIG).write_text(write_toml(find_config(name)), "utf-8")


def test_a_model_that_counts_has_no_epochs(tmp_path: Path) -> None:
    write_config(tmp_path, "mixture")
    summary = summarise_run(tmp_path)
    assert summary.config == find_config("mixture")
    assert (summary.epochs, summary.best, summary.saved) == (0, None, "nothing is saved yet")
    assert summary.again == "starts again"
    plot_run(tmp_path)
    assert not summary.curve.exists()


def test_a_training_that_did_not_end_has_no_end(run: Path) -> None:
    lines = (run / LOG).read_text("utf-8").splitlines(keepends=True)
    (run / LOG).write_text(lines[0] + "".join(lines), "utf-8")
    (run / SEAL).unlink()
    (killed, no_end), (begun, ended) = summarise_run(run).trainings
    assert killed == begun
    assert no_end is None
    assert ended is not None
    assert ended.how == "finished"


def test_what_is_no_run_is_said(tmp_path: Path, run: Path) -> None:
    with pytest.raises(CheckpointError, match="no run there"):
        summarise_run(tmp_path)
    (run / LOG).write_text("{}\n", "utf-8")
    with pytest.raises(DatasetError, match=r"log\.jsonl: was changed"):
        summarise_run(run)
    (run / SEAL).unlink()
    with pytest.raises(TrainingError, match=r"log\.jsonl, line 1: is not a line of"):
        summarise_run(run)
