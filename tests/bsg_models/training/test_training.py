from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import torch
from configurations import configure
from refusals import refuses

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.errors import DatasetError
from bsg_data.recipes import PairsRecipe
from bsg_data.results import name_staged
from bsg_data.seal import SEAL
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.runs.checkpoint import load_checkpoint
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.runs.predictor import Predictor
from bsg_models.runs.run_folder import CONFIG, CURVE, METRICS, RECORD, EpochReport, read_record
from bsg_models.training import epochs, training
from bsg_models.training.buildings import TrainingBatches, validation_buildings
from bsg_models.training.count_gradients import as_network
from bsg_models.training.epochs import Progress, find_device
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.config import (
    RunConfig,
    find_config,
    read_config,
    validate_config,
)
from bsg_robot.answers.seen_building import open_graph

SMALL = ("model.width=8", "model.depth=2", "training.batch_size=4", "training.validate_every=2")


@pytest.fixture(autouse=True)
def _every_validation_saves(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(epochs, "SECONDS_BETWEEN_SAVES", 0.0)


def short(*settings: str, name: str = "ceci") -> RunConfig:
    small = SMALL if name == "ceci" else ()
    return configure(name, *small, "training.epochs=8", *settings)


def test_a_run_leaves_a_checkpoint_metrics_and_what_trains_it_again(
    dataset: Path, tmp_path: Path
) -> None:
    heard: list[EpochReport] = []
    config, run = short("seed=3"), tmp_path / "run"
    reports = train_run(config, dataset, run, progress=heard.append)
    assert list(reports) == heard
    assert [r.epoch for r in reports] == list(range(1, 9))
    assert [r.epoch for r in reports if r.val_loss is not None] == [2, 4, 6, 8]
    lines = (run / METRICS).read_text().splitlines()
    assert [line.partition(",")[0] for line in lines] == ["epoch", *map(str, range(1, 9))]
    best = load_checkpoint(run / BEST).header
    lowest = min((r for r in reports if r.val_loss), key=lambda r: r.val_loss or 0)
    assert (best.epoch, best.val_loss) == (lowest.epoch, lowest.val_loss)
    assert reports[-1].best_epoch == best.epoch
    assert best.dataset_sha256 == Dataset.open(dataset).sha256
    assert validate_config(read_config(run / CONFIG), source="kept") == config
    record = read_record(run)
    assert record
    assert {"belief-scene-graphs", "python", "torch"} <= set(record.versions)
    assert {path.name for path in run.iterdir()} == {SEAL, BEST, CONFIG, RECORD, METRICS, CURVE}


def test_a_mixed_model_is_validated_on_masks_of_its_own(dataset: Path) -> None:
    """Ten masks of every val building, the same again, whose rooms are seen in every way."""
    config = short("data.mask.strategy=mixed", "data.fractions=[0.1,0.9]", name="ceci-sage")
    data = Dataset.open(dataset)
    assert read_manifest(dataset).pairs == PairsRecipe(draws=4)  # uniform ones
    masked, again = (validation_buildings(config, data, vocabulary=()) for _ in range(2))
    assert masked.draws.tolist() == [draw for draw in range(10) for _ in scenes_of(data, "val")]
    assert set(masked.seen.scene_ids) == set(scenes_of(data, "val"))
    assert (masked.seen.inputs == again.seen.inputs).all()
    share = masked.seen.hidden_share[~masked.seen.is_building]
    assert (share == 0).any()
    assert (share == 1).any()
    assert len(set(share[(share > 0) & (share < 1)].tolist())) > 5
    stored = short("data.fractions=[0.1,0.9]", name="ceci-sage")
    assert set(validation_buildings(stored, data, vocabulary=()).draws.tolist()) == {0, 1, 2, 3}


def test_training_learns(dataset: Path, tmp_path: Path) -> None:
    """On buildings that are alike, the loss falls well below that of the first epoch."""
    config = short("training.epochs=20", "model.dropout=0.0")
    reports = train_run(config, dataset, tmp_path / "run")
    assert reports[-1].train_loss < 0.6 * reports[0].train_loss


def stop_at(epoch: int) -> Progress:
    def stop(report: EpochReport) -> None:
        if report.epoch == epoch:
            raise KeyboardInterrupt

    return stop


@pytest.mark.parametrize(
    ("name", "stop", "settings"),
    [
        ("ceci", 5, ("training.decay_as=learning-rate", "training.decay=0.01")),
        ("ensemble", 3, ('model.members=["ceci-sage","gamma-poisson"]',)),
    ],
)
def test_a_stopped_training_goes_on_to_the_bytes_of_an_unbroken_one(
    name: str,
    stop: int,
    settings: tuple[str, ...],
    dataset: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    often = "training.validate_every=2"
    monkeypatch.setattr(training, "find_member", lambda member: short(often, name=member))
    config, run, whole_run = short(*settings, name=name), tmp_path / "stopped", tmp_path / "whole"
    whole = train_run(config, dataset, whole_run)
    with pytest.raises(KeyboardInterrupt):
        train_run(config, dataset, run, progress=stop_at(stop))
    assert not run.exists()
    heard: list[EpochReport] = []
    again = train_run(config, dataset, run, progress=heard.append)
    assert heard[0].epoch == 2 * (stop // 2) + 1
    losses = [[(r.epoch, r.train_loss, r.val_loss) for r in reports] for reports in (whole, again)]
    assert losses[0] == losses[1]
    assert (run / BEST).read_bytes() == (whole_run / BEST).read_bytes()
    if name == "ceci":
        folders = (run, whole_run)
        tables = [np.genfromtxt(path / METRICS, delimiter=",", skip_header=1) for path in folders]
        np.testing.assert_array_equal(*(table[:, :4] for table in tables))
    assert not name_staged(run).exists()


def test_patience_ends_a_training_that_gets_no_better(dataset: Path, tmp_path: Path) -> None:
    settings = ("training.epochs=60", "training.validate_every=1", "training.learning_rate=0.2")
    whole = train_run(short(*settings, "training.patience=3"), dataset, tmp_path / "whole")
    assert len(whole) < 60
    assert len(whole) - whole[-1].best_epoch == 3
    record = read_record(tmp_path / "whole")
    assert record
    assert f"stopped after epoch {len(whole)}" in record.notes[0]
    patient: list[EpochReport] = []
    with pytest.raises(KeyboardInterrupt):
        train_run(
            short(*settings),
            dataset,
            tmp_path / "patient",
            progress=lambda report: (patient.append(report), stop_at(len(whole))(report)),
        )
    assert [r.val_loss for r in patient] == [r.val_loss for r in whole]


def test_what_another_training_left_is_not_gone_on_with(dataset: Path, tmp_path: Path) -> None:
    run, other = tmp_path / "run", short("seed=1")
    with pytest.raises(KeyboardInterrupt):
        train_run(short(), dataset, run, progress=stop_at(4))
    with refuses(TrainingError, "training-other"):
        train_run(other, dataset, run)
    train_run(other, dataset, run, force=True)
    train_run(other, dataset, tmp_path / "alone")
    assert (run / BEST).read_bytes() == (tmp_path / "alone" / BEST).read_bytes()


def test_a_finished_run_is_replaced_as_a_whole_and_by_force_alone(
    dataset: Path, tmp_path: Path
) -> None:
    run = tmp_path / "run"
    train_run(short(), dataset, run)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    with refuses(DatasetError, "path-taken"):
        train_run(short(), dataset, run)
    with pytest.raises(TrainingError, match=r"is not finite.*lower training\.learning_rate"):
        train_run(short("training.learning_rate=1e30"), dataset, run, force=True)
    with pytest.raises(KeyboardInterrupt):
        train_run(short(), dataset, run, force=True, progress=stop_at(4))
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    train_run(short(name="doubled"), dataset, run, force=True)
    assert {path.name for path in run.iterdir()} == {SEAL, BEST, CONFIG, RECORD}


@pytest.mark.parametrize("is_there", [True, False])
def test_a_gpu_is_taken_if_it_is_there(is_there: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: is_there)
    assert find_device("auto") == torch.device("cuda" if is_there else "cpu")
    assert find_device("cpu") == torch.device("cpu")
    if is_there:
        assert find_device("cuda") == torch.device("cuda")
    else:
        with pytest.raises(TrainingError, match=r"use `--set training\.device=cpu`"):
            find_device("cuda")


def test_a_step_asks_its_device_for_no_value_and_shares_nothing_with_the_cpu(dataset: Path) -> None:
    """Torch's device `meta` computes shapes: who reads a value there, or mixes devices, fails.

    So a step on a GPU neither waits nor copies, and the CPU draws the next masks meanwhile.
    """
    data, config, meta = Dataset.open(dataset), find_config("universal"), torch.device("meta")
    network = as_network(training.new_model(config, data))
    assert network is not None
    batch = next(TrainingBatches(config, data, network=network).of(1)).to(meta)
    network.to(meta).train()
    network.loss(batch).backward()  # type: ignore[no-untyped-call]
    norm = torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
    assert norm.device == meta


@pytest.mark.parametrize("name", ["mixture", "train-mean", "universal"])
def test_a_class_that_was_never_taught_is_expected_nowhere_and_said(
    name: str, dataset: Path, tmp_path: Path
) -> None:
    train_run(short("training.epochs=2", name=name), dataset, tmp_path / "run")
    predictor = Predictor(tmp_path / "run")
    data = Dataset.open(dataset)
    objects = sum(data.cells(scene).sum(axis=0) for scene in scenes_of(data, "train"))
    never = [word for word, number in zip(predictor.classes, objects, strict=True) if not number]
    assert list(predictor.untaught) == never != []
    seen = open_graph({"kitchen": [never[0], "chair"], "hall": []}, model=predictor)
    columns = np.isin(predictor.classes, never)
    assert seen.expectation().hidden[:, columns].max() == 0
    assert seen.expectation().hidden[0, ~columns].max() > 0
    assert seen.where(never[0])[0].seen, "what was seen there is there"
    none = f"never taught, so the model expects none: {never[0]}"
    assert any(note.startswith(none) for note in seen.notes)
    assert "table of everyday things" in seen.understand(never[1]).how


@pytest.mark.parametrize("name", [name for name in ZOO if not find_config(name).is_by_seed])
def test_a_model_that_no_seed_changes_is_the_same_by_another(
    name: str, dataset: Path, tmp_path: Path
) -> None:
    states = []
    for seed in range(2):
        train_run(configure(name, f"seed={seed}"), dataset, tmp_path / f"{seed}")
        states.append(load_checkpoint(tmp_path / f"{seed}" / BEST).tensors)
    assert states[0].keys() == states[1].keys()
    assert all((states[1][name] == tensor).all() for name, tensor in states[0].items())
