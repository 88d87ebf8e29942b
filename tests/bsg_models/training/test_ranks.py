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


@pytest.mark.parametrize(("batch_size", "size"), [(32, 2), (7, 3), (3, 3)])
def test_shares_of_a_batch_are_the_batch(batch_size: int, size: int) -> None:
    places = np.arange(2 * batch_size)
    taken = [Ranks(number, size).takes(places, batch_size=batch_size) for number in range(size)]
    assert (np.sum(taken, axis=0) == 1).all()
    for number, mine in enumerate(taken):
        assert mine[:batch_size].sum() == Ranks(number, size).share_of(batch_size)


def test_a_gpu_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert find_device("auto") == find_device("cpu") == torch.device("cpu")
    with pytest.raises(TrainingError, match=r"finds no GPU here; say `--set training\.device=cpu`"):
        find_device("cuda")


def test_a_gpu_is_found_by_the_number_of_the_process(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    monkeypatch.setenv("LOCAL_RANK", "1")
    assert find_device("auto") == find_device("cuda") == torch.device("cuda", 1)
    assert find_device("cpu") == torch.device("cpu")


@pytest.mark.slow
def test_two_processes_train_as_one(
    request: pytest.FixtureRequest, dataset: Path, tmp_path: Path
) -> None:
    """By torchrun, with gloo: the same curve and weights but for rounding, written once."""
    if not request.config.getoption("--full"):
        pytest.skip("gloo may wait for ever as a process ends, its run being whole: pytest --full")
    tables = find_config("universal").model_dump(mode="json")
    config = validate_config(override(tables, SETTINGS), source="test")
    reports = list(train_run(config, dataset, tmp_path / "one"))
    (tmp_path / "run.toml").write_text(write_toml(config))
    train = ["bsg_cli.train", "--config", "run.toml", "--data", str(dataset), "--out", "two"]
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "torch.distributed.run",
            "--standalone",
            "--nproc-per-node",
            "2",
            "-m",
            *train,
        ],
        cwd=tmp_path,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
        capture_output=True,
        text=True,
        check=False,
        timeout=240,
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.count("epochs in") == 1
    two = read_metrics(tmp_path / "two" / METRICS)
    for one, other in zip(reports, two, strict=True):
        assert other.train_loss == pytest.approx(one.train_loss, rel=1e-5)
        assert other.val_loss == pytest.approx(one.val_loss, rel=1e-5)
    weights, others = (load_checkpoint(tmp_path / run / LAST).tensors for run in ("one", "two"))
    assert weights.keys() == others.keys()
    for name, tensor in weights.items():
        assert torch.allclose(tensor, others[name], rtol=1e-4, atol=1e-5), name
    assert load_checkpoint(tmp_path / "two" / BEST).header.calibrated
