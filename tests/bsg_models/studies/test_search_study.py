"""A study: its searches are a recipe, and every planner meets the same."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pyarrow.parquet as pq
import pytest

from bsg_data.dataset.dataset import Dataset, read_cells
from bsg_data.errors import DatasetError, RecipeError
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.studies.savings import encode_study, summarise, write_searches
from bsg_models.studies.search_cases import sample_episodes
from bsg_models.studies.search_request import StudyRecipe
from bsg_models.studies.search_study import Study, study_search

DRAWN = (WorldRecipe(kind="star"), WorldRecipe(kind="tree"))
ORDER = ["scene_id", "world", "task", "planner", "episode"]


def costs_of(study: Study, *, episodes: int = 6) -> list[float]:
    table = study.searches[study.searches.episode < episodes]
    return list(table.sort_values(ORDER).cost)


def test_a_study_depends_on_its_recipe_alone(dataset: Path, run: Path) -> None:
    recipe = StudyRecipe(worlds=DRAWN, episodes=6, draws=3, planners=("ratio", "expected-cost"))
    runs = dict.fromkeys(list(read_cells(dataset))[-2:], run)
    alone = study_search(dataset, runs, recipe)
    with ThreadPoolExecutor(2) as pool:
        together = study_search(dataset, runs, recipe, executor=pool)
    assert together.searches.equals(alone.searches)
    more = study_search(
        dataset, dict(reversed(runs.items())), recipe.model_copy(update={"episodes": 9})
    )
    assert costs_of(more) == costs_of(alone)
    other = study_search(dataset, runs, recipe.model_copy(update={"seed": 1}))
    assert costs_of(other) != costs_of(alone)


def test_artifacts_and_starts_are_possible(dataset: Path) -> None:
    """A start lacks the artifact, which another room has; one room alone cannot be searched."""
    data, recipe = Dataset.open(dataset), StudyRecipe(episodes=50)
    for scene, cells in read_cells(dataset).items():
        episodes = sample_episodes(data, scene, DRAWN[0], recipe)
        if isinstance(episodes, str):
            assert len(cells) == 2
            continue
        for (artifact,), start in zip(episodes.artifacts, episodes.starts, strict=True):
            assert not cells[start, artifact].any()
            assert cells[1:, artifact].any()


def test_buildings_without_a_layout_are_counted(dataset: Path) -> None:
    recipe = StudyRecipe(
        worlds=(WorldRecipe(kind="star"), WorldRecipe(kind="layout")),
        planners=("nearest",),
        episodes=2,
    )
    runs = dict.fromkeys(read_cells(dataset))
    study = study_search(dataset, runs, recipe)
    assert list(study.left_out["layout"].values()) == [12]
    assert set(study.searches.world) == {"star:1-10"}
    only = recipe.model_copy(update={"worlds": (WorldRecipe(kind="layout"),)})
    with pytest.raises(DatasetError):
        study_search(dataset, runs, only)


def test_files_of_a_study(dataset: Path, run: Path, tmp_path: Path) -> None:
    recipe = StudyRecipe(worlds=DRAWN, episodes=3, planners=("ratio",))
    study = study_search(dataset, dict.fromkeys(list(read_cells(dataset))[-2:], run), recipe)
    classes = Dataset.open(dataset).manifest.class_space.classes
    write_searches(study, tmp_path / "searches.parquet")
    table = pq.read_table(tmp_path / "searches.parquet").to_pandas()
    assert len(table) == 2 * 2 * 2 * 3 * 3  # buildings, worlds, tasks, planners, searches
    assert set(table.planner) == {"nearest", "ratio", "routing"}
    results = summarise(study, resamples=0)
    (one,) = [s for s in results if (s.world, s.task) == ("tree:1-10", "all")]
    sums = table[(table.world == "tree:1-10") & (table.task == "all")].groupby("planner").cost.sum()
    assert 1 - sums["ratio"] / sums["nearest"] == pytest.approx(one.savings["ratio"].saved.value)
    report = encode_study(study, results, classes=classes, facts={"model": "m"})
    assert report["recipe"]["worlds"] == ["star:1-10", "tree:1-10"]
    assert report["recipe"]["artifacts"][35] == "stove"
    assert report["standings"][0]["savings"]["nearest"]["beyond_routing"] is None


def test_a_belief_that_is_needed_and_not_there_is_said(dataset: Path) -> None:
    with pytest.raises(RecipeError):
        study_search(dataset, dict.fromkeys(read_cells(dataset)), StudyRecipe(episodes=2))
