"""Ensembles: what their members are, how they are trained, and that they are their mean."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from configurations import configure

from bsg_data.dataset.dataset import Dataset
from bsg_models.errors import ConfigError
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.checkpoint_file import BEST
from bsg_models.training.training import member_config, train_run
from bsg_models.zoo.config import RunConfig
from bsg_models.zoo.model import make_model


def mix(*members: str) -> RunConfig:
    chosen = ", ".join(f'"{name}"' for name in members)
    return configure("ensemble", f"model.members=[{chosen}]")


@pytest.mark.parametrize("members", [("ensemble",), ("mixtrue",)])
def test_members_are_other_models_of_the_zoo(
    dataset: Path, tmp_path: Path, members: tuple[str, ...]
) -> None:
    with pytest.raises(ConfigError):
        train_run(mix(*members), dataset, tmp_path / "run")
    assert not (tmp_path / "run").exists()


def test_an_ensemble_reads_categories_if_a_member_does() -> None:
    assert not mix("gamma-poisson", "mixture").reads_categories
    assert mix("gamma-poisson", "ceci-sage").reads_categories
    model = make_model(mix("gamma-poisson", "ceci-sage"), classes=3, vocabulary=("tap",))
    assert list(model.members) == ["gamma-poisson", "ceci-sage"]
    assert model.vocabulary == ("tap",)
    assert [member.vocabulary for member in model.members.values()] == [(), ("tap",)]


def test_an_ensemble_trains_its_members_and_is_their_mean(dataset: Path, tmp_path: Path) -> None:
    config = configure(
        "ensemble", 'model.members=["gamma-poisson","mixture"]', "model.calibrate=false", "seed=3"
    )
    run = tmp_path / "run"
    assert train_run(config, dataset, run) == ()
    saved = load_checkpoint(run / BEST)
    whole = restore_model(run / BEST, saved)
    seen = read_split(Dataset.open(dataset), "test").seen.take([0])
    members = []
    for name in ("gamma-poisson", "mixture"):
        own = member_config(config, name)
        assert own.seed == 3
        assert own == saved.header.members[name]  # so that another zoo's recipe changes nothing
        train_run(own, dataset, tmp_path / name)
        path = tmp_path / name / BEST
        members.append(restore_model(path, load_checkpoint(path)).predict(seen))
    rooms = np.arange(1, len(seen.inputs))
    found = whole.predict(seen)
    mean = np.mean([m.presence for m in members], axis=0)
    np.testing.assert_allclose(found.presence[rooms], mean[rooms])
    np.testing.assert_allclose(
        found.hidden[rooms], np.mean([m.hidden for m in members], axis=0)[rooms]
    )
