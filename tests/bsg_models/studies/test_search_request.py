from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

import pytest
from conftest import commit_manifest
from pydantic import ValidationError

from bsg_data.dataset.dataset import Dataset
from bsg_data.dataset.manifest import read_manifest
from bsg_data.dataset.splits import split_dataset
from bsg_data.errors import DatasetError, RecipeError
from bsg_data.recipes import SplitRecipe
from bsg_models.inputs.folds import scenes_of
from bsg_models.studies.search_request import (
    SearchRequest,
    choose_buildings,
    choose_default_run,
)


def test_the_default_model_is_taken_where_it_fits(
    shipped: Path, dataset: Path, tmp_path: Path
) -> None:
    def choose(*planners: str, data: Path = dataset, split: str = "test") -> tuple[object, str]:
        return choose_default_run(data, planners=planners or None, split=split)

    runs, said = choose()
    assert runs == (shipped / "universal.safetensors",)
    assert not said
    assert choose("nearest", "ratio")[0] == runs
    assert choose("nearest") == ((), "without a belief: no planner reads one")
    assert choose(split="all")[0] == ()
    folds, other = (Path(shutil.copytree(dataset, tmp_path / name)) for name in ("f", "o"))
    split_dataset(folds, SplitRecipe(method="folds", folds=3, ratios=None), force=True)
    assert "was not trained for these folds" in choose(data=folds)[1]
    manifest = read_manifest(other)
    space = manifest.class_space.model_copy(update={"name": "hm3d45-v9"})
    commit_manifest(other, manifest.model_copy(update={"class_space": space}))
    assert "the dataset has those of hm3d45-v9" in choose(data=other)[1]
    (shipped / "SHA256SUMS").write_text("")
    assert "no model 'universal' is shipped" in choose()[1]


def test_runs_are_asked_about_the_buildings_that_they_do_not_know(dataset: Path, run: Path) -> None:
    data = Dataset.open(dataset)
    chosen, notes = choose_buildings(SearchRequest.read(dataset, runs=(run,)), data)
    assert set(chosen) == set(scenes_of(data, "test"))
    assert notes == []
    with pytest.raises(DatasetError):
        choose_buildings(SearchRequest.read(dataset, runs=(run, run)), data)


@pytest.mark.parametrize(
    "fields",
    [
        {"planners": ("fast",)},
        {"planners": ("ratio",)},  # needs a belief
        {"artifacts": ("spaceship",)},
        {"worlds": ("ring",)},
        {"trace": "auto"},
        {"trace": 200, "runs": (Path("run"),)},  # searches have numbers from 0 to 199
    ],
)
def test_what_cannot_be_searched_is_refused(dataset: Path, fields: dict[str, Any]) -> None:
    with pytest.raises((RecipeError, ValidationError)):
        SearchRequest.read(dataset, **fields)
