"""A source that cannot name a class says nothing of it: masks, pairs, training and evaluation."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import torch

from bsg_data.build import build_dataset
from bsg_data.checks.dataset import check_dataset
from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.merge import merge_datasets
from bsg_data.observation.masked_buildings import MaskedBuildings, sample_masked, stream_masked
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.sources.catalogue import open_source
from bsg_models.belief.count_distribution import poisson
from bsg_models.belief.expectation import Expectation
from bsg_models.evaluation.measurement import Fold, measure, read_truth
from bsg_models.evaluation.truth import Prediction
from bsg_models.studies.comparison import WHOLE, EvaluationRequest, compare_runs
from bsg_models.training.count_gradients import as_network
from bsg_models.zoo.catalogue import UNTRAINED
from bsg_models.zoo.config import find_config
from bsg_models.zoo.gamma_poisson import tally_rooms
from bsg_models.zoo.mixture import read_rooms
from bsg_models.zoo.model import make_model
from bsg_models.zoo.room_types import MISSING, MOST, fit_types

LABELS = [
    f"{name}_{n}_office_{room}_{area}"
    for area in (1, 2, 3)
    for room in (1, 2)
    for n, name in enumerate(["chair", "chair", "table", "clutter"])
]
NAMED = ("bookshelf", "chair", "couch", "table")


@pytest.fixture(scope="module")
def offices(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("offices")
    (folder / "labels.json").write_text(json.dumps(LABELS), "utf-8")
    build_dataset(open_source("s3dis", folder / "labels.json"), folder / "dataset")
    return folder / "dataset"


@pytest.fixture(scope="module")
def merged(offices: Path) -> Path:
    """Return a dataset of three offices, and of three homes whose source has all words."""
    rows = [
        f"home{n},{room},{name}" for n in range(3) for room in "ab" for name in ("bed", "chair")
    ]
    table = offices.with_name("homes.csv")
    table.write_text("\n".join(["scene,room,category", *rows]), "utf-8")
    build_dataset(open_source("table", table), offices.with_name("homes"))
    merge_datasets([offices, offices.with_name("homes")], offices.with_name("merged"))
    return offices.with_name("merged")


def test_the_manifest_has_the_classes_of_a_source_that_lacks_some(merged: Path) -> None:
    sources = {source.kind: source.nameable for source in read_manifest(merged).sources}
    assert sources == {"s3dis": NAMED, "table": None}
    assert read_manifest(merged.with_name("homes")).sources[0].nameable is None
    data = Dataset.open(merged)
    named = [data.manifest.class_space.classes[c] for c in np.flatnonzero(data.nameable("area_1"))]
    assert tuple(named) == NAMED
    assert data.nameable("home1").all()


def check_masked(
    masked: MaskedBuildings, known: np.ndarray[tuple[int], np.dtype[np.bool_]]
) -> None:
    assert masked.seen.withheld[:, ~known].all()
    assert not masked.known[:, ~known].any()
    assert masked.known[:, known].all()
    assert not masked.hidden[:, ~known].any()


def test_masks_and_stored_pairs_withhold_the_others(offices: Path) -> None:
    data = Dataset.open(offices)
    mask = MaskRecipe(strategy="explore")
    check_masked(sample_masked(data, data.scene_ids, mask=mask, draw=0), data.nameable("area_1"))
    split_dataset(offices, SplitRecipe(ratios=(0.4, 0.3, 0.3)), force=True)
    write_pairs(offices, PairsRecipe(mask=mask, draws=3))
    assert check_dataset(offices) == ()
    data = Dataset.open(offices)
    for masked in stream_masked(data, "train"):
        check_masked(masked, data.nameable("area_1"))


def test_only_what_can_be_named_is_measured(merged: Path) -> None:
    """An expectation of beds in offices is neither right nor wrong; in homes it counts."""
    data = Dataset.open(merged)
    values = []
    for kind in ("area", "home"):
        scenes = [scene for scene in data.scene_ids if scene.startswith(kind)]
        masked = sample_masked(data, scenes, mask=MaskRecipe(strategy="rooms"), draw=0)
        for beds in (0.25, 9.0):
            rates = np.full(masked.targets.shape, 0.5)
            rates[:, data.manifest.class_space.class_index("bed")] = beds
            found = Expectation(masked.seen.inputs.astype(float), poisson(rates))
            fold = Fold(tuple(scenes), [{"": Prediction(read_truth(masked), found)}])
            values.append(measure([fold])[""].point)
    office, wrong_office, home, wrong_home = values
    assert {n: office[n] for n in office if office[n] == office[n]} == {
        n: wrong_office[n] for n in office if office[n] == office[n]
    }
    assert office["rooms/hidden_nll"] != pytest.approx(home["rooms/hidden_nll"])
    assert wrong_home["rooms/hidden_nll"] > home["rooms/hidden_nll"] + 0.01


def test_a_class_is_trained_where_it_can_be_named(merged: Path) -> None:
    data = Dataset.open(merged)
    bed = data.manifest.class_space.class_index("bed")
    values, times = tally_rooms(data, data.scene_ids)[bed]
    assert (values.tolist(), times.tolist()) == ([1], [6])  # no office counts as without
    masked = sample_masked(data, data.scene_ids, mask=MaskRecipe(strategy="rooms"), draw=0)
    for name in ("universal", "ceci"):
        model = make_model(find_config(name), classes=len(data.manifest.class_space.classes))
        network = as_network(model)
        assert network is not None
        network.eval()
        nodes = network.read(masked.seen, masked.targets)
        assert torch.isfinite(network.loss(nodes))
        rooms = ~nodes.is_building
        known = masked.known[rooms.numpy()] if name == "universal" else masked.known
        assert network.validation_loss(nodes)[1] == known.sum() < known.size


def test_a_dataset_without_a_split_is_measured_whole(merged: Path) -> None:
    asked = EvaluationRequest(
        runs=("mixture",), dataset=merged, fresh=PairsRecipe(draws=2), resamples=2
    )
    found = compare_runs(asked)
    assert (found.facts["split"], len(found.buildings)) == (WHOLE, 6)
    assert found.facts["nodes"]["building"] == 12
    assert list(found.bootstraps) == ["mixture", *UNTRAINED]
    assert any("no split" in note for note in found.notes)


def test_room_types_leave_out_what_a_room_cannot_name(merged: Path) -> None:
    """The mean of a class is that of the rooms whose source has a word for it."""
    data = Dataset.open(merged)
    bed = data.manifest.class_space.class_index("bed")
    counts, _ = read_rooms(data, data.scene_ids, limit=MOST)
    assert (counts[:, bed] == MISSING).sum() == 6
    fitted = fit_types(counts, types=1, iterations=5, seed=0)
    assert fitted.means[0, bed] == pytest.approx(1)  # in a home; .5 if offices counted as without
    alone = fit_types(counts[counts[:, bed] != MISSING], types=1, iterations=5, seed=0)
    assert fitted.means[0, bed] == pytest.approx(alone.means[0, bed])
    assert np.isfinite(fitted.weigh(counts)[1]).all()
    hidden = replace(fitted, means=fitted.means * np.where(np.arange(45) == bed, 9, 1))
    offices = counts[:, bed] == MISSING
    np.testing.assert_allclose(hidden.weigh(counts)[1][offices], fitted.weigh(counts)[1][offices])
