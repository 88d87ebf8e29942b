"""Runs beside predictions and the baselines on the same masks, and what a comparison leaves."""

from __future__ import annotations

import shutil
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest
from configurations import configure
from conftest import commit_manifest
from pydantic import ValidationError
from refusals import refuses

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError
from bsg_data.observation.mask_hash import hash_splits
from bsg_data.observation.pairs import write_pairs
from bsg_data.recipes import MaskRecipe, PairsRecipe, SplitRecipe
from bsg_data.scene.class_space import load_class_space
from bsg_models.errors import CheckpointError, PredictionError
from bsg_models.evaluation.measurement import Fold, measure, predict_all, read_truth
from bsg_models.evaluation.truth import Prediction
from bsg_models.inputs.graphs import read_split
from bsg_models.runs.checkpoint import CheckpointHeader
from bsg_models.runs.found_model import FoundModel, Kind
from bsg_models.studies.comparison import Comparison, EvaluationRequest, _name_runs, compare_runs
from bsg_models.studies.stored_pairs import MeasuredPairs, name_entry
from bsg_models.training.training import train_run
from bsg_models.zoo.catalogue import BASELINES
from bsg_models.zoo.config import find_config
from bsg_models.zoo.model import make_model
from bsg_models.zoo.settings import DataConfig


def compare(runs: Sequence[Path], dataset: Path, **options: Any) -> Comparison:
    return compare_runs(EvaluationRequest(runs=tuple(runs), dataset=dataset, **options))


def train(dataset: Path, run: Path, *settings: str) -> Path:
    small = ["model.width=8", "training.epochs=2", "training.batch_size=4", *settings]
    list(train_run(configure("ceci", *small), dataset, run))
    return run


def test_runs_are_compared_with_the_baselines_on_the_same_masks(
    dataset: Path, tmp_path: Path
) -> None:
    runs = [train(dataset, tmp_path / "a"), train(dataset, tmp_path / "b", "model.dropout=0.0")]
    found = compare(runs, dataset, split="val", resamples=2)
    names = ("ceci (a)", "ceci (b)")  # two runs of one model
    assert list(found.estimates) == [*names, *BASELINES]
    assert found.runs == names
    graphs = read_split(Dataset.open(dataset), "val")
    truth = read_truth(graphs)
    doubled = make_model(find_config("doubled"), classes=45)
    fold = Fold(truth.scene_ids, [{"": Prediction(truth, predict_all(doubled, graphs))}])
    for name, value in measure([fold])[""].point.items():
        assert found.estimates["doubled"][name].value == pytest.approx(value, nan_ok=True)
    assert len(found.classes) == 6 * 2 * 45
    assert found.facts["buildings"] == 1
    assert [note.split(":")[1] for note in found.notes] == [" measured on 1 building"]


def test_what_a_reader_must_know_is_noted_and_a_changed_pair_refused(
    dataset: Path, run: Path
) -> None:
    other = read_manifest(dataset).model_copy(update={"generator": "another program"})
    commit_manifest(dataset, other)
    found = compare([run], dataset, split="train", resamples=0)
    assert "was trained on another dataset" in found.notes[0]
    assert "were trained on" in found.notes[-1]
    copied = shutil.copytree(dataset, dataset.with_name("copied"))  # an open one keeps its files
    (val,), (test,) = (copied.glob(f"pairs/*/{name}-00000.parquet") for name in ("val", "test"))
    shutil.copy(val, test)
    with refuses(DatasetError, "file-changed"):
        compare([run], copied, resamples=0)


def test_runs_of_different_folds_are_refused(dataset: Path, tmp_path: Path) -> None:
    split_dataset(dataset, SplitRecipe(method="folds", ratios=None, folds=3), force=True)
    write_pairs(dataset, PairsRecipe(draws=1))
    runs = [train(dataset, tmp_path / f"{k}", f"data.fold={k}") for k in (0, 1)]
    assert compare(runs[:1], dataset, resamples=0).facts["fold"] == 0
    with pytest.raises(CheckpointError, match="test on different folds"):
        compare(runs, dataset, resamples=0)


SPACE = load_class_space()


def run_of(model: str, folder: str, kind: Kind = "run") -> tuple[FoundModel, CheckpointHeader]:
    header = CheckpointHeader(
        format_version=1, config=find_config(model), class_space=SPACE, dataset_sha256=""
    )
    return FoundModel(Path(folder) / "best.safetensors", folder, kind), header


@pytest.mark.parametrize(
    ("runs", "names"),
    [
        ([("mixture", "a"), ("ceci", "b")], ("mixture", "ceci")),
        ([("mixture", "a"), ("mixture", "a")], ("mixture (a)", "mixture (a)-2")),
        ([("mixture", "a b"), ("mixture", "a-b")], ("mixture (a b)", "mixture (a-b)-2")),
        ([("gamma-poisson", "a")], ("gamma-poisson (a)",)),  # a baseline has this name
        ([("universal", "best", "shipped"), ("universal", "x")], ("best", "universal")),
    ],
)
def test_a_run_is_named_by_its_model(runs: list[tuple[str, str]], names: tuple[str, ...]) -> None:
    assert _name_runs([run_of(*one) for one in runs]) == names


def test_results_lie_in_the_first_run_unless_a_folder_is_named() -> None:
    request = EvaluationRequest(runs=(Path("a"), Path("b")), dataset=Path("d"))
    assert request.folder == Path("a/evaluation")
    named = EvaluationRequest(runs=(Path("a"),), dataset=Path("d"), out=Path("o"))
    assert named.folder == Path("o")
    with pytest.raises(ValidationError, match="name a run or predictions"):
        EvaluationRequest(runs=(), dataset=Path("d"))
    beside = EvaluationRequest(predictions=(Path("x/mine.parquet"),), dataset=Path("d"))
    assert beside.folder == Path("x/mine-evaluation")


def test_what_a_run_writes_is_measured_as_the_run(dataset: Path, run: Path, tmp_path: Path) -> None:
    data, name = Dataset.open(dataset), "gamma-poisson (run)"
    path = tmp_path / "mine.parquet"
    request = EvaluationRequest(runs=(run,), dataset=dataset, resamples=2)
    with MeasuredPairs(data, "test", (None,)).open_entry(path) as writer:
        compare_runs(request, write=lambda pairs, name, fold: writer)
    both = compare([run], dataset, predictions=[path, path], resamples=2)
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
    measured = []
    for fold in range(3):
        model = make_model(find_config("gamma-poisson"), classes=45)
        model.fit(data, DataConfig(fold=fold))
        masked = read_split(data, "test", fold=fold)
        prediction = Prediction(read_truth(masked), predict_all(model, masked))
        measured.append(Fold(prediction.truth.scene_ids, [{"": prediction}]))
        path = tmp_path / name_entry("mine", fold)
        path.parent.mkdir(exist_ok=True)
        with MeasuredPairs(data, "test", (fold,)).open_entry(path) as writer:
            writer.add(prediction)
    mine = [tmp_path / "mine"]
    every = compare([], dataset, predictions=mine, resamples=0)
    point = measure(measured)[""].point
    for name in ("rooms/presence_ap_micro/all", "all/correlation_frobenius"):
        assert every.estimates["mine"][name].value == pytest.approx(point[name])
        assert every.estimates["gamma-poisson"][name].value == pytest.approx(point[name])
    assert every.facts["masks_sha256"] == hash_splits(data)["all"]
    assert every.facts["buildings"] == 12
    run = train(dataset, tmp_path / "run", "data.fold=1")
    one = compare([run], dataset, predictions=mine, resamples=0)
    name = "rooms/presence_brier/all"
    of_fold = measure([measured[1]])[""].point[name]
    assert one.estimates["mine"][name].value == pytest.approx(of_fold)
    write_pairs(dataset, PairsRecipe(mask=MaskRecipe(seed=1), draws=4), force=True)
    with pytest.raises(PredictionError):  # they are for other masks
        compare([], dataset, predictions=mine, resamples=0)


def test_a_survey_counts_what_is_read_whole(dataset: Path) -> None:
    data = Dataset.open(dataset)
    masked = read_split(data, "train")
    truth, survey = read_truth(masked), MeasuredPairs(data, "train", (None,)).surveys[None]
    assert tuple(survey.scene_id.unique()) == truth.scene_ids
    assert len(survey) == len(masked)
    assert survey.rooms.sum() == (~truth.is_building).sum()
    assert survey.empty_inputs.sum() == (truth.inputs.sum(axis=1) == 0).sum() >= 1
    assert survey.empty_targets.sum() == (truth.targets.sum(axis=1) == 0).sum()
    sizes = {scene: int(data.cells(scene).sum()) for scene in data.scene_ids}
    assert all(sizes[one.scene_id] == one.objects for one in survey.itertuples())
