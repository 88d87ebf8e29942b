"""A study: its searches are a recipe, and its statistics are those worked out by hand."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from bsg_data.dataset.dataset import Dataset, read_cells
from bsg_data.errors import DatasetError, RecipeError
from bsg_models.inputs.folds import scenes_of
from bsg_models.search.catalogue import PLANNERS
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.studies.savings import encode_study, summarise, write_searches
from bsg_models.studies.search_cases import (
    StudyRecipe,
    sample_presence,
    sample_searches,
)
from bsg_models.studies.search_study import Study, choose_runs, study_search

EVERY = tuple(range(45))
BLIND = tuple(name for name in PLANNERS if PLANNERS[name].reads != "belief")
DRAWN = (WorldRecipe(kind="star"), WorldRecipe(kind="tree"))


def costs_of(study: Study) -> list[list[float]]:
    return [o.costs.tolist() for one in study.searches for o in one.outcomes.values()]


def test_a_study_depends_on_its_recipe_alone(dataset: Path, run: Path) -> None:
    recipe = StudyRecipe(artifacts=EVERY, worlds=DRAWN, episodes=6, masks=3)
    runs = dict.fromkeys(list(read_cells(dataset))[-4:], run)
    alone = study_search(dataset, runs, recipe)
    with ThreadPoolExecutor(2) as pool:
        together = study_search(dataset, runs, recipe, executor=pool)
    assert costs_of(alone) == costs_of(together)
    backwards = study_search(dataset, dict(reversed(runs.items())), recipe)
    assert sorted(costs_of(backwards)) == sorted(costs_of(alone))
    more = study_search(dataset, runs, recipe.model_copy(update={"episodes": 9}))
    for few, many in zip(costs_of(alone), costs_of(more), strict=True):
        assert few == many[:6]
    other = study_search(dataset, runs, recipe.model_copy(update={"seed": 1}))
    assert costs_of(other) != costs_of(alone)


def test_artifacts_and_starts_are_possible(dataset: Path) -> None:
    for scene, cells in read_cells(dataset).items():
        rooms = np.arange(len(cells)) > 0
        for at_once in (1, 2):
            recipe = StudyRecipe(artifacts=EVERY, episodes=50, at_once=at_once)
            drawn = sample_searches(cells, rooms, recipe, scene_id=scene)
            if drawn is None:
                assert at_once == 2 or len(cells) == 2
                continue
            artifacts, starts = drawn
            for classes, start in zip(artifacts, starts, strict=True):
                assert len(set(classes.tolist())) == at_once
                assert not cells[start, classes].any()
                assert cells[1:, classes].any(axis=0).all()


def test_searches_for_several_classes_do_not_depend_on_their_number(dataset: Path) -> None:
    for scene, cells in read_cells(dataset).items():
        rooms = np.arange(len(cells)) > 0
        few, many = (
            sample_searches(cells, rooms, StudyRecipe(episodes=e, at_once=4), scene_id=scene)
            for e in (2, 300)
        )
        assert (few is None) == (many is None)
        if few is not None and many is not None:
            np.testing.assert_array_equal(few[0], many[0][:2])
            np.testing.assert_array_equal(few[1], many[1][:2])


def test_a_room_that_alone_holds_an_artifact_leaves_nothing_to_search() -> None:
    cells = np.array([[3, 0], [1, 0], [2, 0]])  # every room has the only class that is there
    recipe = StudyRecipe(artifacts=(0, 1), at_once=1)
    assert sample_searches(cells, np.arange(3) > 0, recipe, scene_id="s") is None


def test_buildings_without_a_layout_are_counted(dataset: Path) -> None:
    recipe = StudyRecipe(
        artifacts=EVERY,
        worlds=(WorldRecipe(kind="star"), WorldRecipe(kind="layout")),
        planners=("nearest",),
        episodes=2,
    )
    runs = dict.fromkeys(read_cells(dataset))
    study = study_search(dataset, runs, recipe)
    (reason,) = study.left_out["layout"]
    assert study.left_out["layout"][reason] == 12
    assert {one.world for one in study.searches} == {"star:1-10"}
    only = recipe.model_copy(update={"worlds": (WorldRecipe(kind="layout"),)})
    with pytest.raises(DatasetError, match="nothing can be searched"):
        study_search(dataset, runs, only)


def test_the_posterior_is_drawn_given_that_one_is_somewhere() -> None:
    presence = np.array([0.0, 0.3, 0.5, 0.1])
    rooms = np.array([False, True, True, True])
    many = 40_000
    drawn = sample_presence(
        np.broadcast_to(presence[None, :, None], (many, 4, 1)),
        np.broadcast_to(rooms, (many, 4)),
        np.random.default_rng(0),
    )[:, :, 0]
    assert drawn.any(axis=1).all()
    somewhere = 1 - 0.7 * 0.5 * 0.9
    np.testing.assert_allclose(drawn.mean(axis=0), presence / somewhere, atol=0.01)
    few = sample_presence(
        np.broadcast_to(presence[None, :, None], (3, 4, 1)),
        np.broadcast_to(rooms, (3, 4)),
        np.random.default_rng(0),
    )
    np.testing.assert_array_equal(few[:, :, 0], drawn[:3])
    both = (drawn[:, 1] & drawn[:, 2]).mean()
    assert both == pytest.approx(0.3 * 0.5 / somewhere, abs=0.01)


def test_where_the_belief_is_right_expected_cost_saves_most(dataset: Path, run: Path) -> None:
    recipe = StudyRecipe(
        artifacts=EVERY, worlds=DRAWN, episodes=200, tasks=("single",), truth="posterior"
    )
    study = study_search(dataset, dict.fromkeys(list(read_cells(dataset))[-6:], run), recipe)
    for results in summarise(study, resamples=0):
        saved = {name: one.saved.value for name, one in results.savings.items()}
        best = max(v for name, v in saved.items() if name != "oracle")
        assert saved["oracle"] > saved["expected-cost"] >= best - 0.02
        assert results.savings["oracle"].of_oracle.value == 1


def test_a_robot_that_stops_itself_costs_less_and_misses_more(dataset: Path, run: Path) -> None:
    recipe = StudyRecipe(
        artifacts=EVERY, worlds=DRAWN[:1], episodes=30, tasks=("all",), stops=(0.5, 0.001)
    )
    study = study_search(dataset, dict.fromkeys(list(read_cells(dataset))[-4:], run), recipe)
    (results,) = summarise(study, resamples=50)
    eager, careful = results.stops["0.5"], results.stops["0.001"]
    assert eager.saved.value > careful.saved.value >= 0
    assert eager.missed.value > careful.missed.value
    assert "sweep" not in results.savings


def test_files_of_a_study(dataset: Path, run: Path, tmp_path: Path) -> None:
    recipe = StudyRecipe(artifacts=EVERY, worlds=DRAWN, episodes=3, planners=("ratio",))
    study = study_search(dataset, dict.fromkeys(list(read_cells(dataset))[-2:], run), recipe)
    classes = Dataset.open(dataset).manifest.class_space.classes
    write_searches(study, classes, tmp_path / "searches.parquet")
    table = pq.read_table(tmp_path / "searches.parquet").to_pandas()
    assert len(table) == 2 * 2 * 2 * 3 * 3  # buildings, worlds, tasks, planners, searches
    assert set(table.planner) == {"nearest", "ratio", "routing"}
    (one,) = [s for s in summarise(study, resamples=0) if (s.world, s.task) == ("tree:1-10", "all")]
    sums = table[(table.world == "tree:1-10") & (table.task == "all")].groupby("planner").cost.sum()
    assert 1 - sums["ratio"] / sums["nearest"] == pytest.approx(one.savings["ratio"].saved.value)
    text = json.dumps(
        encode_study(study, summarise(study, resamples=0), classes=classes, facts={"model": "m"}),
        allow_nan=False,
    )
    report = json.loads(text)
    assert report["recipe"]["worlds"] == ["star:1-10", "tree:1-10"]
    assert report["recipe"]["artifacts"][35] == "stove"
    assert report["scenes"] == list(study.scenes)
    assert report["standings"][0]["savings"]["nearest"]["beyond_routing"] is None


def test_runs_are_asked_about_the_buildings_that_they_do_not_know(dataset: Path, run: Path) -> None:
    chosen, notes = choose_runs(dataset, [run])
    assert set(chosen) == set(scenes_of(Dataset.open(dataset), "test"))
    assert notes == []
    with pytest.raises(DatasetError, match="same buildings"):
        choose_runs(dataset, [run, run])


def test_a_belief_that_is_needed_and_not_there_is_said(dataset: Path) -> None:
    nobody = dict.fromkeys(read_cells(dataset))
    for recipe, words in (
        (StudyRecipe(episodes=2, worlds=DRAWN), "needs a belief"),
        (StudyRecipe(episodes=2, planners=BLIND, truth="posterior"), "needs a belief"),
        (StudyRecipe(episodes=2, planners=BLIND, worlds=DRAWN, artifacts=(45,)), "artifact 45"),
    ):
        with pytest.raises(RecipeError, match=words):
            study_search(dataset, nobody, recipe)
    with pytest.raises(ValueError, match="no planner 'fast'"):
        StudyRecipe(planners=("fast",))
    with pytest.raises(ValueError, match="less than 1"):
        StudyRecipe(stops=(1.0,))
