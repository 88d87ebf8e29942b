"""What stored pairs hold; predictions beside runs, and runs as predictions."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import pytest

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation import pairs
from bsg_data.observation.mask_hash import hash_splits
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_models.errors import PredictionError
from bsg_models.evaluation.measurement import Fold, measure, predict_all, read_truth
from bsg_models.inputs.graphs import read_split
from bsg_models.studies.comparison import compare_runs
from bsg_models.studies.stored_pairs import folds_of, join_surveys, open_entry, survey_split
from bsg_models.zoo.catalogue import BASELINES
from bsg_models.zoo.config import find_config
from bsg_models.zoo.ensemble import make_model
from bsg_models.zoo.settings import DataConfig


def test_what_a_run_writes_is_measured_as_the_run(dataset: Path, run: Path, tmp_path: Path) -> None:
    data, name = Dataset.open(dataset), "gamma-poisson (run)"
    path = tmp_path / "mine.parquet"
    with open_entry(tmp_path, "mine", data, split="test", fold=None) as writer:
        compare_runs([run], dataset, split="test", resamples=2, write=lambda name, fold: writer)
    both = compare_runs([run], dataset, split="test", predictions=[path, path], resamples=2)
    assert both.runs == (name, "mine", "mine-2")
    assert list(both.estimates) == [name, "mine", "mine-2", *BASELINES]
    assert both.facts["predictions"]["mine"]["exactly"] == 16
    assert both.facts["masks_sha256"] == hash_splits(data)["test"]
    ours, theirs = both.estimates[name], both.estimates["mine"]
    for metric, estimate in ours.items():
        exact = "hidden_nll" not in metric
        close = pytest.approx(estimate.value, rel=1e-9 if exact else 1e-4, nan_ok=True)
        assert theirs[metric].value == close, metric


def test_predictions_of_all_folds_are_measured_fold_by_fold(dataset: Path, tmp_path: Path) -> None:
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=3), force=True)
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(strategy="explore"), draws=2))
    data = Dataset.open(dataset)
    assert folds_of(data, None) == (0, 1, 2)
    assert folds_of(data, 1) == (1,)
    measured = []
    for fold in range(3):
        model = make_model(find_config("gamma-poisson"), classes=45)
        model.fit(data, DataConfig(fold=fold))
        masked = read_split(data, "test", fold=fold)
        expectation = predict_all(model, masked)
        truth = read_truth(masked)
        measured.append(Fold(truth.scene_ids, [(truth, expectation)]))
        with open_entry(tmp_path, "mine", data, split="test", fold=fold) as writer:
            writer.add(expectation, masked)
    every = compare_runs([], dataset, split="test", predictions=[tmp_path / "mine"], resamples=0)
    point = measure(measured).point
    for name in ("rooms/presence_ap_micro/all", "all/correlation_frobenius"):
        assert every.estimates["mine"][name].value == pytest.approx(point[name])
        assert every.estimates["gamma-poisson"][name].value == pytest.approx(point[name])
    assert every.facts["masks_sha256"] == hash_splits(data)["all"]
    assert every.facts["buildings"] == 12
    one = compare_runs(
        [], dataset, split="test", predictions=[tmp_path / "mine"], fold=1, resamples=0
    )
    name = "rooms/presence_brier/all"
    assert one.estimates["mine"][name].value == pytest.approx(measure([measured[1]]).point[name])


def test_predictions_for_other_masks_are_refused(dataset: Path, run: Path, tmp_path: Path) -> None:
    data = Dataset.open(dataset)
    model = make_model(find_config("doubled"), classes=45)
    masked = read_split(data, "test")
    path = tmp_path / "mine.parquet"
    with open_entry(tmp_path, "mine", data, split="test", fold=None) as writer:
        writer.add(predict_all(model, masked), masked)
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(seed=1), draws=4), force=True)
    with pytest.raises(PredictionError):
        compare_runs([], dataset, split="test", predictions=[path], resamples=0)


def test_a_survey_counts_what_is_read_whole(dataset: Path) -> None:
    data = Dataset.open(dataset)
    masked = read_split(data, "train")
    truth, survey = read_truth(masked), survey_split(data, "train", fold=None)
    assert survey.scene_ids == truth.scene_ids
    assert survey.masked == len(masked)
    assert survey.counts["rooms"] == (~truth.is_building).sum()
    assert survey.counts["empty_inputs"] == (truth.inputs.sum(axis=1) == 0).sum() >= 1
    assert survey.counts["empty_targets"] == (truth.targets.sum(axis=1) == 0).sum()
    sizes = {scene: int(data.cells(scene).sum()) for scene in data.scene_ids}
    assert survey.by_size == sorted(survey.scene_ids, key=lambda scene: sizes[scene])
    assert survey.example == survey.by_size[len(survey.by_size) // 2]
    both = join_surveys([survey, survey_split(data, "test", fold=None)])
    assert both.counts["rooms"] > survey.counts["rooms"]
    for nodes, stride in ((19_990, 1), (19_991, 2)):
        assert replace(survey, counts={"rooms": nodes, "building": 10}).stride == stride


def test_a_split_of_no_pairs_is_refused(dataset: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of which every building has more objects of a class than pairs can count."""
    monkeypatch.setattr(pairs, "fits_pairs", lambda cells: False)
    write_pairs(dataset, PairsRecipe(), force=True)
    with pytest.raises(DatasetError):
        survey_split(Dataset.open(dataset), "test", fold=None)
