"""A study: its searches are a recipe, and its statistics are those worked out by hand."""

from __future__ import annotations

import json
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from bsg_data.dataset.histograms import read_cells
from bsg_data.errors import DatasetError, RecipeError
from bsg_models.inputs.graphs import open_dataset
from bsg_models.rendering.explorer import explorer_page
from bsg_models.search.planners import PLANNERS
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.search.simulator import Outcome
from bsg_models.studies.replay import TraceRequest, trace_search
from bsg_models.studies.savings import interval, saving_of_buildings, summarise
from bsg_models.studies.search_cases import StudyRecipe, sample_presence, sample_searches
from bsg_models.studies.search_files import encode_study, write_searches
from bsg_models.studies.search_study import Searches, Study, choose_runs, study_search

EVERY = tuple(range(45))
BLIND = tuple(name for name, planner in PLANNERS.items() if planner.reads != "belief")
DRAWN = (WorldRecipe(kind="star"), WorldRecipe(kind="tree"))


def costs_of(study: Study) -> list[list[float]]:
    return [o.costs.tolist() for one in study.searches for o in one.outcomes.values()]


@pytest.mark.slow
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


def by_hand(scene: str, nearest: list[float], ours: list[float]) -> Searches:
    number = len(nearest)
    outcomes = {
        ("single", name): Outcome(np.array(costs), np.ones(number, int), np.zeros(number, int))
        for name, costs in {"nearest": nearest, "ratio": ours, "routing": nearest}.items()
    }
    whole = np.zeros(number, dtype=np.int64)
    return Searches(
        scene_id=scene,
        world="star:1-10",
        starts=whole,
        artifacts=whole[:, None],
        draws=whole,
        instances=whole + 1,
        ranked_first=whole + 1.0,
        chance=whole + 0.5,
        outcomes=outcomes,  # type: ignore[arg-type]
    )


def test_savings_by_hand() -> None:
    searches = (by_hand("a", [4.0, 6.0], [2.0, 6.0]), by_hand("b", [10.0], [15.0]))
    recipe = StudyRecipe(tasks=("single",))
    (one,) = summarise(Study(recipe, ("a", "b"), searches, {}), resamples=500)
    ratio = one.savings["ratio"]
    assert ratio.saved.value == pytest.approx(1 - 23 / 20)
    assert np.isnan(ratio.saved.low)  # of two buildings there is no interval
    (many,) = summarise(Study(recipe, (), searches * 3, {}), resamples=2000)
    low, high = many.savings["ratio"].saved.low, many.savings["ratio"].saved.high
    assert many.savings["ratio"].saved.value == ratio.saved.value
    assert low == pytest.approx(1 - (8 + 5 * 15) / (10 + 5 * 10))  # five of six are b
    assert high == pytest.approx(1 - (5 * 8 + 15) / (5 * 10 + 10))
    assert ratio.mean == pytest.approx((0.5 + 0.0 - 0.5) / 3)
    assert ratio.median == 0.0
    assert (ratio.wins, ratio.ties, ratio.losses) == (1, 1, 1)
    assert ratio.beyond_routing.value == pytest.approx(ratio.saved.value)
    assert np.isnan(ratio.of_oracle.value)
    assert np.isnan(one.savings["nearest"].beyond_routing.value)
    assert (one.searches, one.buildings, one.ranked_first, one.chance) == (3, 2, 1.0, 0.5)
    assert saving_of_buildings(searches, "single", "ratio") == pytest.approx([0.2, -0.5])


def test_an_interval_needs_resamples() -> None:
    assert np.isnan(interval(np.array([1.0])).low)
    assert interval(np.array([1.0, 0.0, 2.0])).value == 1.0


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
    classes = open_dataset(dataset).manifest.class_map.classes
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
    assert set(chosen) == set(open_dataset(dataset).scenes_of("test"))
    assert notes == []
    with pytest.raises(DatasetError, match="same buildings"):
        choose_runs(dataset, [run, run])


def test_a_trace_tells_the_search_again(dataset: Path, run: Path) -> None:
    scene = max(read_cells(dataset).items(), key=lambda item: len(item[1]))[0]
    recipe = StudyRecipe(artifacts=EVERY, worlds=DRAWN, episodes=5, planners=("ratio",))
    study = study_search(dataset, {scene: run}, recipe)
    (one,) = [s for s in study.searches if s.world == "tree:1-10"]
    request = TraceRequest(scene, 3, DRAWN[1], "all", "ratio")
    views = trace_search(dataset, run, recipe, request)
    outcome = one.outcomes["all", "ratio"]
    moments = [view.moment for view in views]
    last = moments[-1]
    assert last is not None
    assert len(views) == 1 + outcome.entered[3]
    assert last.cost == pytest.approx(outcome.costs[3])
    assert last.target is None
    assert last.route[0] == one.starts[3]
    assert set(last.holds) <= set(last.route)
    artifact = one.artifacts[3, 0]
    for view, moment in zip(views, moments, strict=True):
        assert moment is not None
        seen = [o.room_index for o in view.belief.partial.objects if o.class_index == artifact]
        assert set(seen) == set(moment.holds) & set(moment.route)
        searched = [i for i, r in enumerate(view.belief.partial.rooms, 1) if r.hidden_share == 0]
        assert sorted(moment.route) == searched
    assert views[0].moment is not None
    assert views[0].moment.legs[0] is None  # in a tree of rooms the building is out of reach
    assert '"legs":[null,' in explorer_page(views)
    with pytest.raises(DatasetError, match="no search number 5"):
        trace_search(dataset, run, recipe, TraceRequest(scene, 5, DRAWN[1], "all", "ratio"))


def test_a_belief_that_is_needed_and_not_there_is_said(dataset: Path) -> None:
    nobody = dict.fromkeys(read_cells(dataset))
    for recipe, words in (
        (StudyRecipe(episodes=2, worlds=DRAWN), "needs a belief"),
        (StudyRecipe(episodes=2, planners=BLIND, truth="posterior"), "needs a belief"),
        (StudyRecipe(episodes=2, planners=BLIND, worlds=DRAWN, artifacts=(45,)), "artifact 45"),
    ):
        with pytest.raises(RecipeError, match=words):
            study_search(dataset, nobody, recipe)
    with pytest.raises(ValueError, match="'fast' is none of"):
        StudyRecipe(planners=("fast",))
    with pytest.raises(ValueError, match="less than 1"):
        StudyRecipe(stops=(1.0,))
