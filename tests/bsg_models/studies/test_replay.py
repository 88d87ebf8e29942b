"""A replay shows the search that ran: its rooms, its costs, and the beliefs its planner had."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from bsg_data.dataset.dataset import Dataset, read_cells
from bsg_data.errors import RecipeError
from bsg_models.rendering.replay import Replay, Walk
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.studies.replay import choose_replay, replay_search
from bsg_models.studies.savings import summarise
from bsg_models.studies.search_cases import StudyRecipe
from bsg_models.studies.search_steps import KeepRequest, KeptSearch
from bsg_models.studies.search_study import Searches, Study, study_search

WORLDS = (WorldRecipe(kind="star"), WorldRecipe(kind="tree"))
RECIPE = StudyRecipe(worlds=WORLDS, episodes=5, masks=2, at_once=2, planners=("ratio",))
EPISODE = 3


@pytest.fixture
def scene(dataset: Path) -> str:
    """The largest building."""
    return max(read_cells(dataset).items(), key=lambda item: len(item[1]))[0]


@pytest.fixture
def study(dataset: Path, run: Path, scene: str) -> Study:
    keep = KeepRequest(EPISODE, "all", "ratio", world="tree:1-10")
    return study_search(dataset, {scene: run}, RECIPE, keep=keep)


@pytest.fixture
def searches(study: Study) -> Searches:
    (kept,) = [one for one in study.searches if one.kept]
    return kept


@pytest.fixture
def kept(searches: Searches) -> KeptSearch:
    (one,) = searches.kept
    return one


@pytest.fixture
def replay(dataset: Path, study: Study, kept: KeptSearch) -> Replay:
    return replay_search(
        dataset, study, summarise(study, resamples=0), kept, model="gamma-poisson", named=True
    )


@pytest.fixture
def walk(replay: Replay) -> Walk:
    return replay.walks[0]


def test_both_planners_are_kept_in_the_search_that_was_asked_for(
    searches: Searches, kept: KeptSearch
) -> None:
    """Same start, artifacts, mask and costs: one record has them; the steps are its two walks."""
    assert (kept.world, kept.task, kept.planner) == ("tree:1-10", "all", "ratio")
    assert kept.start == searches.starts[EPISODE]
    assert kept.artifacts == tuple(searches.artifacts[EPISODE])
    assert kept.draw == EPISODE % RECIPE.masks
    assert list(kept.walks) == ["ratio", "nearest"]
    for planner, steps in kept.walks.items():
        outcome = searches.outcomes["all", planner]
        assert len(steps) == outcome.entered[EPISODE] > 1
        assert sum(step.cost for step in steps) == pytest.approx(outcome.costs[EPISODE])
    ours, base = (walk[0] for walk in kept.walks.values())
    np.testing.assert_array_equal(ours.distance, base.distance)
    assert ours.presence.any()
    assert not base.presence.any()  # `nearest` is given no belief


def test_keeping_steps_changes_no_search(
    dataset: Path, run: Path, scene: str, study: Study
) -> None:
    without = study_search(dataset, {scene: run}, RECIPE)
    for one, other in zip(study.searches, without.searches, strict=True):
        assert other.kept == ()
        for key, outcome in one.outcomes.items():
            np.testing.assert_array_equal(outcome.costs, other.outcomes[key].costs)


def test_without_a_number_the_rule_chooses(dataset: Path, run: Path, scene: str) -> None:
    study = study_search(dataset, {scene: run}, RECIPE, keep=KeepRequest(None, "all", "ratio"))
    assert [len(one.kept) for one in study.searches] == [RECIPE.episodes] * 2
    results = summarise(study, resamples=0)
    shown = choose_replay(study, results, named=False)
    assert shown.world == "star:1-10"  # the first, as none is measured
    replay = replay_search(dataset, study, results, shown, model=None, named=False)
    assert replay.chosen.startswith("This search was chosen as worth watching")
    assert ("but no search met the rule" in replay.chosen) == (not shown.eventful)
    with pytest.raises(RecipeError, match="kept no search"):
        choose_replay(replace(study, searches=study.searches[:0]), results, named=False)


def test_a_number_is_of_the_first_building(dataset: Path, run: Path) -> None:
    """In the first building that is searched, whatever was saved in the others."""
    scenes = sorted(read_cells(dataset))[5:8]
    keep = KeepRequest(EPISODE, "all", "ratio")
    study = study_search(dataset, dict.fromkeys(scenes, run), RECIPE, keep=keep)
    shown = choose_replay(study, summarise(study, resamples=0), named=True)
    assert (shown.scene_id, shown.world, shown.episode) == (scenes[0], "star:1-10", EPISODE)
    backwards = replace(study, searches=study.searches[::-1])
    shown = choose_replay(backwards, summarise(study, resamples=0), named=True)
    assert (shown.scene_id, shown.world) == (scenes[-1], "tree:1-10")


def test_the_presence_shown_is_that_which_the_planner_was_given(
    kept: KeptSearch, walk: Walk
) -> None:
    given = [1 - (1 - step.presence[1:]).prod(axis=1) for step in kept.walks["ratio"]]
    assert len(walk.stops) == len(given) + 1
    entered: list[int] = []
    for stop, presence in zip(walk.stops, [*given, given[-1]], strict=True):
        entered.append(stop.room)
        assert stop.presence is not None
        shown = np.array(stop.presence)
        assert not shown[np.array(entered) - 1].any()
        open_ = np.setdiff1d(np.arange(len(shown)), np.array(entered) - 1)
        np.testing.assert_allclose(shown[open_], presence[open_], atol=1e-4)


def test_the_route_ends_with_the_last_artifact(
    searches: Searches, replay: Replay, walk: Walk
) -> None:
    first, last = walk.stops[0], walk.stops[-1]
    assert (first.cost, first.way, first.found) == (0, (), ())
    assert last.cost == pytest.approx(searches.outcomes["all", "ratio"].costs[EPISODE], abs=1e-3)
    assert (last.target, last.leg) == (None, None)
    assert set(replay.holds) == {stop.room for stop in walk.stops if stop.found}
    assert last.found
    for before, stop in zip(walk.stops, walk.stops[1:], strict=False):
        assert stop.way[-1] == stop.room
        assert set(stop.way[:-1]) <= {one.room for one in walk.stops[: walk.stops.index(stop)]}
        assert stop.cost >= before.cost


def test_a_stop_tells_what_is_in_the_room_and_the_artifacts_first(
    dataset: Path, kept: KeptSearch, walk: Walk
) -> None:
    data = Dataset.open(dataset)
    classes, cells = data.manifest.class_space.classes, data.cells(kept.scene_id)
    for stop in walk.stops:
        there = {classes[c]: n for c, n in enumerate(cells[stop.room].tolist()) if n}
        assert set(stop.seen) <= set(there.items())
        assert [name for name, _ in stop.seen[: len(stop.found)]] == list(stop.found)
        rest = [count for _, count in stop.seen[len(stop.found) :]]
        assert rest == sorted(rest, reverse=True)


def test_the_means_of_all_searches_stand_beside_the_one(study: Study, replay: Replay) -> None:
    (result,) = [
        one
        for one in summarise(study, resamples=0)
        if (one.world, one.task) == (replay.world, replay.task)
    ]
    assert (replay.searches, replay.buildings) == (5, 1)
    assert [walk.planner for walk in replay.walks] == ["ratio", "nearest"]
    assert [walk.model for walk in replay.walks] == ["gamma-poisson", None]
    for walk in replay.walks:
        assert walk.mean_cost == result.savings[walk.planner].cost
        assert walk.mean_saved.value == result.savings[walk.planner].saved.value
    assert replay.chosen == "This search was named by its number, so it need not be typical."
    assert replay.unit == ""
    assert replay.doors == ()  # of a drawn world they would be wrong


def test_a_room_that_cannot_be_reached_is_not_drawn(
    dataset: Path, study: Study, kept: KeptSearch
) -> None:
    """The costs of the first step say which rooms belong to the world."""
    far = kept.walks["ratio"][0].distance.copy()
    visited = {kept.start, *(step.entered for steps in kept.walks.values() for step in steps)}
    lost = min(set(range(1, len(far))) - visited)
    far[lost] = np.inf
    first, *others = kept.walks["ratio"]
    walks = {**kept.walks, "ratio": (replace(first, distance=far), *others)}
    results = summarise(study, resamples=0)
    replay = replay_search(
        dataset, study, results, replace(kept, walks=walks), model=None, named=True
    )
    assert lost not in {room.number for room in replay.plan.rooms}
    assert replay.left_out == 1


@pytest.mark.parametrize(
    "keep",
    [
        KeepRequest(5, "all", "ratio"),
        KeepRequest(-1, "all", "ratio"),
        KeepRequest(None, "all", "oracle"),
    ],
)
def test_a_search_that_is_not_there_cannot_be_kept(dataset: Path, keep: KeepRequest) -> None:
    with pytest.raises(RecipeError):
        study_search(dataset, {}, RECIPE, keep=keep)
