"""The conditional model by hand, and ensembles as checkpoints."""

from __future__ import annotations

import json
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch
from one_building import observe_building

from bsg_data.dataset.dataset import Dataset
from bsg_data.observation.masked_buildings import stack_masked
from bsg_data.seals import SEAL
from bsg_models.belief.count_distribution import negative_binomial
from bsg_models.errors import ConfigError, TrainingError
from bsg_models.inputs.edges import edges_of
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import load_checkpoint, restore_model
from bsg_models.runs.run_folder import BEST, CONFIG, LAST, LOG, MEMBERS
from bsg_models.training.training import new_model, train_run
from bsg_models.zoo.calibration import fit_calibration, recalibrate
from bsg_models.zoo.catalogue import ZOO
from bsg_models.zoo.conditional import ConditionalConfig, ConditionalModel
from bsg_models.zoo.config import RunConfig, find_config, override, validate_config
from bsg_models.zoo.ensemble import Ensemble
from bsg_models.zoo.masked_rooms import stream_uniform
from bsg_models.zoo.model import ModelInputs, Network
from bsg_models.zoo.settings import DataConfig


def configure(name: str, *settings: str) -> RunConfig:
    return validate_config(
        override(find_config(name).model_dump(mode="json"), settings), source="test"
    )


def test_conditional_is_the_mean_over_what_was_seen() -> None:
    model = ConditionalModel(ConditionalConfig(observe="classes"), ModelInputs(classes=2))
    model.presence.copy_(torch.tensor([[0.8, 0.1], [0.2, 0.5], [0.3, 0.3]]))
    model.hidden.copy_(torch.tensor([[2.6, 0.2], [0.4, 1.0], [0.6, 0.6]]))
    model.fraction.fill_(0.5)
    found = model.predict(observe_building([[9, 9], [2, 0], [1, 3], [0, 0]]))
    np.testing.assert_allclose(found.presence[1:], [[0.8, 0.1], [0.5, 0.3], [0.3, 0.3]])
    np.testing.assert_allclose(found.hidden[1:], [[2.6, 0.2], [1.5, 0.6], [0.6, 0.6]])
    quarter = model.predict(observe_building([[2, 0], [2, 0]], hidden_share=0.25))
    np.testing.assert_allclose(quarter.hidden[1], [1.3, 0.1])
    np.testing.assert_allclose(quarter.presence[1], 1 - np.sqrt([0.2, 0.9]))


@pytest.mark.parametrize("observe", ["classes", "counts"])
def test_conditional_counts_as_a_naive_loop_does(dataset: Path, observe: str) -> None:
    data = Dataset.open(dataset)
    config = ConditionalConfig(observe=observe, draws=2, smoothing=1.5)  # type: ignore[arg-type]
    model = ConditionalModel(config, ModelInputs(classes=45))
    model.fit(data, DataConfig())
    masked = stack_masked(list(stream_uniform(data, DataConfig(), draws=2)))
    rows = ~masked.seen.is_building
    seen, hidden = masked.seen.inputs[rows], (masked.targets - masked.seen.inputs)[rows]
    classes = data.manifest.class_space.classes
    levels = 4 if observe == "counts" else 1
    for name, level in (("chair", 2), ("pillow", 1), ("bed", 1)):
        j = classes.index(name)
        observed = np.minimum(seen[:, j], levels) == min(level, levels)
        for c in range(45):
            overall = (hidden[:, c] > 0).mean()
            expected = ((hidden[observed, c] > 0).sum() + 1.5 * overall) / (observed.sum() + 1.5)
            row = j * levels + min(level, levels) - 1
            assert float(model.presence[row, c]) == pytest.approx(expected)


def spoil(texts: list[dict[str, Any]], how: str) -> bytes:
    """Return the trees of a checkpoint, packed again, with one fault."""
    if how == "cut":
        return zlib.compress(json.dumps(texts).encode())[:50]
    if how == "few":
        texts = texts[:3]
    elif how == "not finite":
        texts[0]["start"] = float("nan")
    elif how == "no text":
        texts[0] = {"start": 0.0, "trees": 7}
    elif how == "no list":
        texts = 5  # type: ignore[assignment]
    return zlib.compress(json.dumps(texts).encode())


@pytest.mark.parametrize(
    ("name", "settings"),
    [
        ("conditional", ("data.mask.fraction=0.0",)),
    ],
)
def test_masks_that_hide_nothing_are_refused(
    dataset: Path, tmp_path: Path, name: str, settings: tuple[str, ...]
) -> None:
    with pytest.raises(TrainingError, match="hide nothing"):
        list(train_run(configure(name, *settings), dataset, tmp_path / "run"))


def test_more_room_types_than_rooms_are_refused(dataset: Path, tmp_path: Path) -> None:
    with pytest.raises(TrainingError, match=r"too few for 1000 room types; lower model\.types"):
        list(train_run(configure("mixture", "model.types=1000"), dataset, tmp_path / "run"))


def test_an_ensemble_replaces_a_run_whole(dataset: Path, tmp_path: Path) -> None:
    small = ("training.epochs=2", "model.width=8")
    list(train_run(configure("ceci-sage", *small), dataset, tmp_path / "run"))
    members = 'model.members=["train-mean","gamma-poisson"]'
    list(train_run(configure("ensemble", members), dataset, tmp_path / "run", force=True))
    left = {path.name for path in (tmp_path / "run").iterdir()}
    assert left == {BEST, MEMBERS, CONFIG, LOG, SEAL}


@pytest.mark.parametrize(
    ("members", "message"),
    [
        ('["ensemble"]', "ensemble is an ensemble itself"),
        ('["mixture","mixture"]', "^test: model: members must differ, found mixture, mixture$"),
        ('["mixtrue"]', "did you mean mixture"),
    ],
)
def test_members_are_different_models_of_the_zoo(
    dataset: Path, tmp_path: Path, members: str, message: str
) -> None:
    def train() -> None:
        config = configure("ensemble", f"model.members={members}")
        list(train_run(config, dataset, tmp_path / "run"))

    with pytest.raises(ConfigError, match=message):
        train()
    assert not (tmp_path / "run").exists()


def test_an_ensemble_trains_its_members_and_is_their_mean(dataset: Path, tmp_path: Path) -> None:
    config = configure(
        "ensemble", 'model.members=["gamma-poisson","mixture"]', "model.calibrate=false", "seed=3"
    )
    run = tmp_path / "run"
    assert list(train_run(config, dataset, run)) == []
    saved = load_checkpoint(run / BEST)
    assert (
        saved.header.members["mixture"]
        == load_checkpoint(run / MEMBERS / "mixture" / BEST).header.config
    )  # so that another zoo's recipe of this name changes nothing
    whole = restore_model(run / BEST, saved)
    seen = read_split(Dataset.open(dataset), "test").seen.take([0])
    members = []
    for name in ("gamma-poisson", "mixture"):
        path = run / MEMBERS / name / BEST
        checkpoint = load_checkpoint(path)
        assert checkpoint.header.config.seed == 3
        members.append(restore_model(path, checkpoint).predict(seen))
    rooms = np.arange(1, len(seen.inputs))
    found = whole.predict(seen)
    mean = np.mean([m.presence for m in members], axis=0)
    np.testing.assert_allclose(found.presence[rooms], mean[rooms])
    np.testing.assert_allclose(
        found.hidden[rooms], np.mean([m.hidden for m in members], axis=0)[rooms]
    )
    assert not (run / LAST).exists()
    stamps = [(run / MEMBERS / n / BEST).stat().st_mtime_ns for n in ("gamma-poisson", "mixture")]
    list(train_run(config, dataset, run, resume=True))  # finished members are kept
    assert stamps == [
        (run / MEMBERS / n / BEST).stat().st_mtime_ns for n in ("gamma-poisson", "mixture")
    ]


def test_calibration_mends_what_is_too_sure() -> None:
    rng = np.random.default_rng(0)
    rates = rng.gamma(1.0, 2.0, (4000, 3))
    hidden = rng.poisson(rng.gamma(2.0, rates / 2.0)).astype(float)
    distorted = negative_binomial(0.6 * rates**1.4, np.full(rates.shape, 5.0))
    found = fit_calibration(distorted, hidden)
    mended = recalibrate(distorted, found)
    assert mended.log_probability(hidden).mean() > distorted.log_probability(hidden).mean()
    np.testing.assert_allclose(np.exp(found[1]), 1 / 1.4, rtol=0.05)
    np.testing.assert_allclose(mended.dispersions[0, 0, 0], 2.0, rtol=0.15)
    perfect = negative_binomial(rates, np.full(rates.shape, 2.0))
    np.testing.assert_allclose(fit_calibration(perfect, hidden), 0, atol=0.05)


def test_every_member_of_an_ensemble_makes_graphs_with_its_own_edges(dataset: Path) -> None:
    config = configure("ensemble", 'model.members=["ceci-sage","room-transformer"]')
    assert ZOO["ceci-sage"].data.edges != ZOO["room-transformer"].data.edges
    data = Dataset.open(dataset)
    whole = new_model(config, data)
    assert isinstance(whole, Ensemble)
    torch.manual_seed(0)
    for parameter in whole.parameters():  # as if trained: no head is all zeros
        torch.nn.init.normal_(parameter, std=0.1)
    seen = read_split(data, "test", vocabulary=whole.vocabulary).seen.take([0])
    expected = []
    for name, member in whole.members.items():
        assert isinstance(member, Network)
        edges = edges_of(seen, ZOO[name].data.edges)
        assert member.graph_of(seen).edge_index.tolist() == edges.tolist()
        alone = new_model(find_config(name), data)  # that knows of no ensemble
        alone.load_state_dict(member.state_dict())
        expected.append(alone.predict(seen).presence)
    found = whole.predict(seen).presence
    np.testing.assert_allclose(found[1:], np.mean(expected, axis=0)[1:], rtol=1e-5)
