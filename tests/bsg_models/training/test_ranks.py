from __future__ import annotations

import gc
import os
import subprocess
import sys
from contextlib import nullcontext
from pathlib import Path

import pytest
import torch
from torch import distributed
from torch.nn.parallel import DistributedDataParallel
from torch_geometric.data import Data

from bsg_data.dataset.dataset import Dataset
from bsg_models.errors import TrainingError
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.run_folder import BEST, LAST, METRICS
from bsg_models.training.epochs import GradientSteps
from bsg_models.training.learning_curve import read_metrics
from bsg_models.training.ranks import Ranks, find_device, join_ranks, leads_training
from bsg_models.training.training import new_model, train_run
from bsg_models.zoo.config import find_config, override, validate_config, write_toml
from bsg_models.zoo.model import Network

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


@pytest.mark.parametrize("fails", [False, True])
def test_what_shares_gradients_is_gone_before_the_processes_part(
    fails: bool, dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Also after an error, whose traceback held it; else gloo may wait for ever at its end."""
    config = validate_config(
        override(find_config("ceci-gcn").model_dump(mode="json"), ["model.width=4"]), source="test"
    )
    model = new_model(config, Dataset.open(dataset))
    assert isinstance(model, Network)
    store = f"file://{tmp_path / 'store'}"
    distributed.init_process_group("gloo", init_method=store, rank=0, world_size=1)
    try:
        ranks = Ranks(0, 2)  # of a group of one: nothing here asks the other
        steps = GradientSteps(model, config, device=torch.device("cpu"), ranks=ranks)
        monkeypatch.setattr(model, "loss", lambda graphs: 1 / 0 if fails else torch.ones(1))
        with pytest.raises(ZeroDivisionError) if fails else nullcontext(), steps.join():
            assert _count_sharing() == 1
            steps._loss(Data())
        assert _count_sharing() == 0
    finally:
        distributed.destroy_process_group()


def _count_sharing() -> int:
    return sum(type(one) is DistributedDataParallel for one in gc.get_objects())


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
    train = ["bsg_cli.train", "--config", "run.toml", "--data", str(dataset), "--out", "two"]
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
        assert torch.allclose(tensor, others[name], rtol=1e-4, atol=1e-5), name
    assert load_checkpoint(tmp_path / "two" / BEST).header.calibrated
