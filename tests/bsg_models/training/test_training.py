from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from safetensors.numpy import load_file

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.results import SEAL
from bsg_models.errors import TrainingError
from bsg_models.inputs.folds import scenes_of
from bsg_models.robot.seen_building import open_graph
from bsg_models.runs.checkpoint import (
    CheckpointHeader,
    load_checkpoint,
    save_checkpoint,
)
from bsg_models.runs.predictor import Predictor
from bsg_models.runs.run_folder import BEST, LAST, LOG, METRICS
from bsg_models.studies.run_summary import summarise_run
from bsg_models.training import training
from bsg_models.training.buildings import TrainingBuildings, validation_buildings
from bsg_models.training.count_gradients import as_network
from bsg_models.training.epochs import find_device
from bsg_models.training.learning_curve import read_metrics
from bsg_models.training.training import train_run
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.model import State

SMALL = ("model.width=8", "model.depth=2", "training.batch_size=4", "training.validate_every=2")


def configure(*settings: str, name: str = "ceci-gcn") -> RunConfig:
    small = SMALL if name == "ceci-gcn" else ()
    return validate_config(
        override(
            find_config(name).model_dump(mode="json"), [*small, "training.epochs=8", *settings]
        ),
        source="test",
    )


def weights(path: Path) -> State:
    return load_file(path)


def same(a: State, b: State) -> bool:
    return a.keys() == b.keys() and all(np.array_equal(a[name], b[name]) for name in a)


def test_a_run_leaves_checkpoints_and_metrics(dataset: Path, tmp_path: Path) -> None:
    reports = list(train_run(configure(), dataset, tmp_path / "run"))
    assert [r.epoch for r in reports] == list(range(1, 9))
    assert [r.epoch for r in reports if r.val_loss is not None] == [2, 4, 6, 8]
    assert read_metrics(tmp_path / "run" / METRICS)[-1].epoch == 8
    best = load_checkpoint(tmp_path / "run" / BEST).header
    lowest = min((r for r in reports if r.val_loss), key=lambda r: r.val_loss or 0)
    assert (best.epoch, best.val_loss) == (lowest.epoch, lowest.val_loss)
    assert reports[-1].best_epoch == best.epoch
    assert best.dataset_sha256 == Dataset.open(dataset).sha256


def test_a_mixed_model_is_validated_on_masks_of_its_own(dataset: Path) -> None:
    """Ten masks of every val building, the same again, whose rooms are seen in every way."""
    config = configure("data.mask.strategy=mixed", "data.fractions=[0.1,0.9]", name="ceci-sage")
    data = Dataset.open(dataset)
    assert read_manifest(dataset).pairs == PairsRecipe(draws=4)  # uniform ones
    one, again = (validation_buildings(config, data, vocabulary=()) for _ in range(2))
    assert one.draws.tolist() == [draw for draw in range(10) for _ in scenes_of(data, "val")]
    assert set(one.seen.scene_ids) == set(scenes_of(data, "val"))
    assert (one.seen.inputs == again.seen.inputs).all()
    share = one.seen.hidden_share[~one.seen.is_building]
    assert (share == 0).any()
    assert (share == 1).any()
    assert len(set(share[(share > 0) & (share < 1)].tolist())) > 5
    stored = configure("data.fractions=[0.1,0.9]", name="ceci-sage")
    assert set(validation_buildings(stored, data, vocabulary=()).draws.tolist()) == {0, 1, 2, 3}


def test_training_learns(dataset: Path, tmp_path: Path) -> None:
    """On buildings that are alike, the loss falls well below that of the first epoch."""
    config = configure("training.epochs=120", "model.dropout=0.0")
    reports = list(train_run(config, dataset, tmp_path / "run"))
    assert reports[-1].train_loss < 0.5 * reports[0].train_loss


@pytest.mark.parametrize("masks", ["fresh", "fixed"])
def test_the_same_seed_gives_the_same_weights_and_another_does_not(
    dataset: Path, tmp_path: Path, masks: str
) -> None:
    for name, seed in (("a", 0), ("b", 0), ("c", 1)):
        config = configure(f"seed={seed}", f"data.masks={masks}")
        list(train_run(config, dataset, tmp_path / name))
    a, b, c = (weights(tmp_path / name / LAST) for name in "abc")
    assert same(a, b)
    assert not same(a, c)


@pytest.mark.parametrize(("stop", "decay"), [(1, "weight-decay"), (5, "learning-rate")])
def test_a_stopped_run_resumes_to_the_same_weights(
    dataset: Path, tmp_path: Path, stop: int, decay: str
) -> None:
    config = configure(f"training.decay_as={decay}", "training.decay=0.01")
    list(train_run(config, dataset, tmp_path / "whole"))
    for report in train_run(config, dataset, tmp_path / "stopped"):
        if report.epoch == stop:
            break  # as Ctrl-C does: the generator is closed between two epochs
    resumed = list(train_run(config, dataset, tmp_path / "stopped", resume=True))
    assert resumed[0].epoch == 2 * (stop // 2) + 1
    for name in (LAST, BEST):
        assert same(weights(tmp_path / "whole" / name), weights(tmp_path / "stopped" / name))
    whole, stopped = (read_metrics(tmp_path / n / METRICS) for n in ("whole", "stopped"))
    assert [(r.epoch, r.train_loss, r.val_loss) for r in whole] == [
        (r.epoch, r.train_loss, r.val_loss) for r in stopped
    ]


def test_a_run_can_be_made_longer(dataset: Path, tmp_path: Path) -> None:
    list(train_run(configure(), dataset, tmp_path / "long"))
    list(train_run(configure("training.epochs=4"), dataset, tmp_path / "short"))
    list(train_run(configure(), dataset, tmp_path / "short", resume=True))
    assert same(weights(tmp_path / "long" / LAST), weights(tmp_path / "short" / LAST))


@pytest.mark.parametrize("name", ["gamma-poisson", "ceci-gcn"])
def test_a_job_that_is_started_again_leaves_a_finished_run_as_it_is(
    name: str, dataset: Path, tmp_path: Path
) -> None:
    """It has the same command line: nothing may be there, half, or all."""
    run, config = tmp_path / "run", configure(name=name)
    list(train_run(config, dataset, run, resume=True))
    saved = (run / BEST).read_bytes()
    (run / SEAL).unlink()  # as if it had been killed before it was through
    list(train_run(config, dataset, run, resume=True))
    assert (run / BEST).read_bytes() == saved
    before = {path.name: path.stat().st_mtime_ns for path in run.iterdir()}
    list(train_run(config, dataset, run, resume=True))
    assert {path.name: path.stat().st_mtime_ns for path in run.iterdir()} == before


def test_what_cannot_be_resumed_is_refused(dataset: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    list(train_run(configure(), dataset, run))
    with pytest.raises(TrainingError, match="--resume continues it, --force replaces"):
        list(train_run(configure(), dataset, run))
    with pytest.raises(TrainingError, match=r"model\.dropout: 0\.5 → 0\.1"):
        list(train_run(configure("model.dropout=0.1"), dataset, run, resume=True))
    with pytest.raises(
        TrainingError, match=r"another configuration .*model\.family: ceci-gcn → doub"
    ):
        list(train_run(configure(name="doubled"), dataset, run, resume=True))
    split_dataset(dataset, SplitRecipe(seed=5), force=True)
    before = {path.name: path.read_bytes() for path in run.iterdir()}
    with pytest.raises(DatasetError, match="has no pairs"):
        list(train_run(configure(), dataset, run, force=True))
    assert {path.name: path.read_bytes() for path in run.iterdir()} == before
    write_pairs(dataset, PairsRecipe(draws=1))
    with pytest.raises(TrainingError, match="was trained on another dataset"):
        list(train_run(configure(), dataset, run, resume=True))
    list(train_run(configure(name="doubled"), dataset, run, force=True))
    assert not (run / LAST).exists()


def test_two_trainings_never_write_into_one_run(dataset: Path, tmp_path: Path) -> None:
    first = train_run(configure(), dataset, tmp_path / "run")
    next(first)
    with pytest.raises(DatasetError, match="another command is writing there"):
        list(train_run(configure(), dataset, tmp_path / "run", force=True))
    list(first)
    list(train_run(configure(), dataset, tmp_path / "alone"))
    assert same(weights(tmp_path / "run" / LAST), weights(tmp_path / "alone" / LAST))


def test_a_run_that_lost_a_part_is_not_resumed(dataset: Path, tmp_path: Path) -> None:
    run, longer = tmp_path / "run", configure("training.epochs=10")
    list(train_run(configure(), dataset, run))
    whole = (run / METRICS).read_text()
    (run / METRICS).write_text("nonsense\n1\n")
    with pytest.raises(DatasetError, match=r"metrics\.csv: was changed"):
        list(train_run(longer, dataset, run, resume=True))
    (run / "SHA256SUMS").unlink()  # as of a run that was stopped
    with pytest.raises(TrainingError, match="not the metrics of a run"):
        list(train_run(longer, dataset, run, resume=True))
    (run / METRICS).write_text("".join(whole.splitlines(keepends=True)[:-1]))
    with pytest.raises(TrainingError, match=r"metrics\.csv: is gone"):
        list(train_run(longer, dataset, run, resume=True))
    (run / METRICS).write_text(whole)
    (run / BEST).unlink()
    with pytest.raises(TrainingError, match="is gone"):
        list(train_run(longer, dataset, run, resume=True))


def test_a_diverging_run_says_so_and_keeps_what_it_had(dataset: Path, tmp_path: Path) -> None:
    run = tmp_path / "run"
    list(train_run(configure("training.epochs=2"), dataset, run))
    header = load_checkpoint(run / LAST).header
    hot = header.config.training.model_copy(update={"learning_rate": 1e30})
    config = header.config.model_copy(update={"training": hot})
    rewrite(run / LAST, weights(run / LAST), config=config)
    (run / "SHA256SUMS").unlink()  # as of a run that was stopped
    before = {name: (run / name).read_bytes() for name in (BEST, LAST, METRICS)}
    longer = config.model_copy(update={"training": hot.model_copy(update={"epochs": 9})})
    with pytest.raises(TrainingError, match=r"is not finite.*lower training\.learning_rate"):
        list(train_run(longer, dataset, run, resume=True))
    assert {name: (run / name).read_bytes() for name in before} == before
    assert '"how":"failed"' in (run / LOG).read_text("utf-8").splitlines()[-1]


def rewrite(path: Path, tensors: State, **update: Any) -> None:
    header = load_checkpoint(path).header.model_copy(update=update)
    save_checkpoint(path, CheckpointHeader.model_validate(header.model_dump()), tensors)


def test_a_calibration_of_a_sample_says_so(
    dataset: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    config = configure("model.iterations=2", name="mixture")
    monkeypatch.setattr(training, "_CALIBRATED_NODES", 20)
    list(train_run(config, dataset, tmp_path / "some"))
    (note,) = summarise_run(tmp_path / "some").notes
    assert re.fullmatch(
        r"calibrated on a random sample of \d of \d masked val buildings: at most 20 nodes", note
    )


def test_a_gpu_that_is_not_there_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: False)
    assert find_device("auto") == find_device("cpu") == torch.device("cpu")
    with pytest.raises(TrainingError, match=r"finds no GPU here; use `--set training\.device=cpu`"):
        find_device("cuda")


def test_a_gpu_that_is_there_is_taken_if_wanted(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(torch.cuda, "is_available", lambda: True)
    assert find_device("auto") == find_device("cuda") == torch.device("cuda")
    assert find_device("cpu") == torch.device("cpu")


@pytest.mark.parametrize("name", ["ceci-gcn", "ceci-sage", "universal"])
def test_a_step_asks_its_device_for_no_value_and_shares_nothing_with_the_cpu(
    name: str, dataset: Path
) -> None:
    """Torch's device `meta` computes shapes: who reads a value there, or mixes devices, fails.

    So a step on a GPU neither waits nor copies, and the CPU draws the next masks meanwhile.
    """
    data, config, meta = Dataset.open(dataset), find_config(name), torch.device("meta")
    network = as_network(training.new_model(config, data))
    assert network is not None
    buildings = TrainingBuildings(config, data, vocabulary=network.vocabulary)
    some = next(buildings.batches(1))
    nodes = network.nodes_of(some.seen, some.targets).to(meta)
    network.to(meta).train()
    network.loss(nodes).backward()  # type: ignore[no-untyped-call]
    norm = torch.nn.utils.clip_grad_norm_(network.parameters(), 5.0)
    assert norm.device == meta


@pytest.mark.parametrize("name", ["mixture", "gamma-poisson", "train-mean", "universal"])
def test_a_class_that_was_never_taught_is_expected_nowhere_and_said(
    name: str, dataset: Path, tmp_path: Path
) -> None:
    list(train_run(configure("training.epochs=2", name=name), dataset, tmp_path / "run"))
    predictor = Predictor(tmp_path / "run")
    data = Dataset.open(dataset)
    objects = sum(data.cells(scene).sum(axis=0) for scene in scenes_of(data, "train"))
    never = [one for one, number in zip(predictor.classes, objects, strict=True) if not number]
    assert list(predictor.untaught) == never != []
    seen = open_graph({"kitchen": [never[0], "chair"], "hall": []}, model=predictor)
    columns = np.isin(predictor.classes, never)
    assert seen.expectation().hidden[:, columns].max() == 0
    assert seen.expectation().hidden[0, ~columns].max() > 0
    assert seen.where(never[0])[0].seen, "what was seen there is there"
    assert any(
        note.startswith(f"never taught, so none is expected: {never[0]}") for note in seen.notes
    )
    assert f"no training building had a {never[1]}" in seen.understand(never[1]).how
