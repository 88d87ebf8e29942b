from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
import torch

from bsg_models.errors import TrainingError
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.run_folder import BEST, LAST, METRICS
from bsg_models.training.learning_curve import read_metrics
from bsg_models.training.ranks import Ranks, find_device, join_ranks, leads_training
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config, override, validate_config, write_toml

# Dropout draws other numbers in each process; nothing else of a training may differ.
SETTINGS = (
    "model.width=8",
    "model.embedding=4",
    "model.dropout=0.0",
    "model.category_dropout=0.0",
    "model.forget=0.0",
    "training.epochs=2",
    "training.batch_size=4",
    "training.validate_every=1",
)


def test_a_process_alone_leads() -> None:
    with join_ranks(torch.device("cpu")) as ranks:
        assert ranks == Ranks(0, 1)
        assert ranks.leads
        ranks.wait()
        assert ranks.add(torch.ones(2)).tolist() == [1, 1]
    assert leads_training()


def test_a_gpu_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert find_device("auto") == find_device("cpu") == torch.device("cpu")
    with pytest.raises(TrainingError, match=r"finds no GPU here; use `--set training\.device=cpu`"):
        find_device("cuda")


def test_a_gpu_is_found_by_the_number_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setenv("LOCAL_RANK", "1")
    assert find_device("auto") == find_device("cuda") == torch.device("cuda", 1)
    assert find_device("cpu") == torch.device("cpu")


def run_by_torchrun(command: list[str], folder: Path) -> str:
    """Run a module in two processes and return what they say; kill all where they hang."""
    torchrun = ["torch.distributed.run", "--standalone", "--nproc-per-node", "2", "-m", *command]
    with subprocess.Popen(
        [sys.executable, "-m", *torchrun],
        cwd=folder,
        env={**os.environ, "OMP_NUM_THREADS": "1", "PYTHONSAFEPATH": "1"},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        try:
            said, errors = process.communicate(timeout=240)
        except subprocess.TimeoutExpired:
            process.terminate()  # whereupon it ends its processes, and kills them after 30 s
            pytest.fail("two processes hang")
    assert process.returncode == 0, errors
    return said


@pytest.mark.heavy
def test_two_processes_train_as_one(dataset: Path, tmp_path: Path) -> None:
    """By torchrun, with gloo: the same curve and weights but for rounding, written once."""
    tables = find_config("universal").model_dump(mode="json")
    config = validate_config(override(tables, SETTINGS), source="test")
    reports = list(train_run(config, dataset, tmp_path / "one"))
    (tmp_path / "run.toml").write_text(write_toml(config))
    if sys.version_info >= (3, 11):  # else Python does not know PYTHONSAFEPATH
        (tmp_path / "random.py").write_text("open('it ran', 'w')", "utf-8")
    train = ["bsg_cli.train", str(dataset), "--config", "run.toml", "--out", "two"]
    said = run_by_torchrun(train, tmp_path)
    assert said.count("epochs in") == 1
    assert not (tmp_path / "it ran").exists()
    two = read_metrics(tmp_path / "two" / METRICS)
    for one, other in zip(reports, two, strict=True):
        assert other.train_loss == pytest.approx(one.train_loss, rel=1e-5)
        assert other.val_loss == pytest.approx(one.val_loss, rel=1e-5)
    weights, others = (load_checkpoint(tmp_path / run / LAST).tensors for run in ("one", "two"))
    assert weights.keys() == others.keys()
    for name, tensor in weights.items():
        assert np.allclose(tensor, others[name], rtol=1e-4, atol=1e-5), name
    assert load_checkpoint(tmp_path / "two" / BEST).header.calibrated
