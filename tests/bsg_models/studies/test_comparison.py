"""Runs beside the baselines on the same masks, and what a comparison leaves."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest
from conftest import commit_manifest
from refusals import refuses

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import PairsRecipe, SplitRecipe
from bsg_data.scene.class_space import load_class_space
from bsg_models.errors import CheckpointError
from bsg_models.evaluation.catalogue import head_value, list_values
from bsg_models.evaluation.measurement import Fold, measure, predict_all, read_truth
from bsg_models.evaluation.verdict import HEADLINES
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.found_model import FoundModel, Kind
from bsg_models.studies.comparison import (
    compare_runs,
    encode_comparison,
    headline_rows,
    metric_rows,
    name_runs,
)
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import BASELINES
from bsg_models.zoo.config import find_config, override, validate_config
from bsg_models.zoo.ensemble import make_model


def train(dataset: Path, run: Path, *settings: str) -> Path:
    small = ["model.width=8", "training.epochs=2", "training.batch_size=4", *settings]
    config = validate_config(
        override(find_config("ceci-gcn").model_dump(mode="json"), small), source="test"
    )
    list(train_run(config, dataset, run))
    return run


def test_runs_are_compared_with_the_baselines_on_the_same_masks(
    dataset: Path, tmp_path: Path
) -> None:
    runs = [train(dataset, tmp_path / "a"), train(dataset, tmp_path / "b", "model.dropout=0.0")]
    found = compare_runs(runs, dataset, split="val", resamples=2)
    names = ("ceci-gcn (a)", "ceci-gcn (b)")  # two runs of one model
    assert list(found.estimates) == [*names, *BASELINES]
    assert found.runs == names
    graphs = read_split(Dataset.open(dataset), "val")
    truth = read_truth(graphs)
    doubled = make_model(find_config("doubled"), classes=45)
    fold = Fold(truth.scene_ids, [(truth, predict_all(doubled, graphs))])
    alone = measure([fold]).point
    for name, value in alone.items():
        assert found.estimates["doubled"][name].value == pytest.approx(value, nan_ok=True)
    assert len(found.classes) == 6 * 2 * 45
    assert found.facts["buildings"] == 1
    assert [note.split(":")[1] for note in found.notes] == [" measured on 1 building"]


def test_what_a_reader_must_know_is_noted(dataset: Path, tmp_path: Path) -> None:
    run = train(dataset, tmp_path / "a")
    other = read_manifest(dataset).model_copy(update={"generator": "another program"})
    commit_manifest(dataset, other)
    found = compare_runs([run], dataset, split="train", resamples=0)
    assert "ceci-gcn was trained on another dataset" in found.notes[0]
    assert "were trained on" in found.notes[1]


def test_runs_of_different_folds_are_refused(dataset: Path, tmp_path: Path) -> None:
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=3), force=True)
    write_pairs(dataset, PairsRecipe(draws=1))
    runs = [train(dataset, tmp_path / f"{k}", f"data.fold={k}") for k in (0, 1)]
    assert compare_runs(runs[:1], dataset, split="test", resamples=0).facts["fold"] == 0
    with pytest.raises(CheckpointError, match="test on different folds"):
        compare_runs(runs, dataset, split="test", resamples=0)


def test_a_changed_pair_is_not_measured(dataset: Path, tmp_path: Path) -> None:
    run = train(dataset, tmp_path / "a")
    (val,), (test,) = (dataset.glob(f"pairs/*/{name}-00000.parquet") for name in ("val", "test"))
    shutil.copy(val, test)
    other = read_manifest(dataset).model_copy(update={"generator": "another program"})
    commit_manifest(dataset, other)  # it is not the one that is open already
    with refuses(DatasetError, "file-changed", golden=False):
        compare_runs([run], dataset, split="test", resamples=0)


def test_what_a_comparison_leaves(dataset: Path, tmp_path: Path) -> None:
    compared = compare_runs([train(dataset, tmp_path / "a")], dataset, split="val", resamples=4)
    models = ["ceci-gcn", *BASELINES]
    report = json.loads(json.dumps(encode_comparison(compared), allow_nan=False))
    assert report["split"] == "val"
    assert tuple(report["metrics"]) == list_values()
    nll = compared.estimates["ceci-gcn"]["rooms/hidden_nll"]
    assert report["metrics"]["rooms/hidden_nll"]["ceci-gcn"] == {
        "value": nll.value,
        "low": nll.low,
        "high": nll.high,
        "nodes": nll.nodes,
    }
    assert report["metrics"]["rooms/presence_brier/unvisited"]["ceci-gcn"]["value"] is None
    rows = headline_rows(compared)  # uniform masks leave no room unvisited
    names = (*HEADLINES["what is hidden"], *HEADLINES["whole histograms"])
    assert [row[0] for row in rows] == [head_value(name) for name in names]
    assert {len(row) for row in rows} == {1 + len(models)}
    every = {row[0]: row[1:] for row in metric_rows(compared)}
    assert tuple(every) == list_values()
    assert every["rooms/presence_brier/unvisited"][1:] == ["-"] * len(models)
    assert every["rooms/hidden_nll"][0] == str(nll.nodes)
    assert every["rooms/hidden_nll"][1:] == rows[0][1:]


SPACE = load_class_space()


def run_of(model: str, folder: str, kind: Kind = "run") -> tuple[FoundModel, CheckpointHeader]:
    header = CheckpointHeader(config=find_config(model), class_space=SPACE, dataset_sha256="")
    return FoundModel(Path(folder) / "best.safetensors", folder, kind), header


@pytest.mark.parametrize(
    ("runs", "names"),
    [
        ([("mixture", "a"), ("ceci-gcn", "b")], ("mixture", "ceci-gcn")),
        ([("mixture", "a"), ("mixture", "b")], ("mixture (a)", "mixture (b)")),
        ([("mixture", "a"), ("mixture", "a")], ("mixture (a)", "mixture (a)-2")),
        ([("mixture", "a b"), ("mixture", "a-b")], ("mixture (a b)", "mixture (a-b)-2")),
        ([("gamma-poisson", "a")], ("gamma-poisson (a)",)),  # a baseline has this name
        ([("universal", "best", "shipped"), ("universal", "x")], ("best", "universal")),
        ([("mixture", "mixture")], ("mixture",)),
    ],
)
def test_a_run_is_named_by_its_model(runs: list[tuple[str, str]], names: tuple[str, ...]) -> None:
    assert name_runs([run_of(*one) for one in runs]) == names
