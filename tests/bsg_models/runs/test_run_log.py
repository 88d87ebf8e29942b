"""What a run says of its trainings: by hand, again, stopped, failed and gone on with."""

from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.dataset.dataset import Dataset
from bsg_models.runs.run_folder import CONFIG, LOG
from bsg_models.runs.run_log import Begun, Ended, keep_log, read_log
from bsg_models.training.training import train_run
from bsg_models.zoo.config import (
    RunConfig,
    find_config,
    override,
    read_config,
    validate_config,
)

SMALL = ["model.width=8", "training.epochs=4", "training.batch_size=4", "training.validate_every=2"]


def configure(*settings: str) -> RunConfig:
    tables = override(find_config("ceci-gcn").model_dump(mode="json"), [*SMALL, *settings])
    return validate_config(tables, source="test")


def test_a_run_is_trained_again_by_what_it_kept(dataset: Path, tmp_path: Path) -> None:
    config = configure("seed=3")
    list(train_run(config, dataset, tmp_path / "a"))
    kept = validate_config(read_config(tmp_path / "a" / CONFIG), source="kept")
    assert kept == config
    list(train_run(kept, dataset, tmp_path / "b"))
    for name in ("best.safetensors", CONFIG):
        assert (tmp_path / "a" / name).read_bytes() == (tmp_path / "b" / name).read_bytes()
    timeless = [
        [line.model_copy(update={"time": "", "seconds": 0.0}) for line in read_log(tmp_path / run)]
        for run in ("a", "b")
    ]
    assert timeless[0] == timeless[1]


def test_every_training_leaves_two_lines(dataset: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    for report in train_run(configure(), dataset, run):
        if report.epoch == 3:
            break
    list(train_run(configure(), dataset, run, resume=True))
    begun, stopped, again, finished = read_log(run)
    assert isinstance(begun, Begun)
    assert (begun.seed, begun.epochs, begun.from_epoch) == (0, 4, 0)
    assert begun.dataset_sha256 == Dataset.open(dataset).sha256
    assert {"belief-scene-graphs", "python", "torch"} <= set(begun.versions)
    assert isinstance(stopped, Ended)
    assert (stopped.how, stopped.epoch, stopped.error) == ("stopped", 2, None)
    assert isinstance(again, Begun)
    assert again.from_epoch == 2
    assert isinstance(finished, Ended)
    assert (finished.how, finished.epoch) == ("finished", 4)
    list(train_run(configure("seed=1"), dataset, run, force=True))
    assert len(read_log(run)) == 2  # a run that is replaced takes its log with it


def test_a_training_that_fails_says_why(dataset: Path, tmp_path: Path) -> None:
    data = Dataset.open(dataset)
    with pytest.raises(ValueError, match="no luck"), keep_log(tmp_path, configure(), data):
        raise ValueError("no luck")
    ended = read_log(tmp_path)[-1]
    assert isinstance(ended, Ended)
    assert (ended.how, ended.epoch, ended.error) == ("failed", 0, "no luck")


def test_a_run_without_a_log_says_nothing(tmp_path: Path) -> None:
    assert read_log(tmp_path) == ()
    (tmp_path / LOG).write_bytes(b"")
    assert read_log(tmp_path) == ()
