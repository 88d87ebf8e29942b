"""A replay shows the search that ran: its rooms, its costs, and the beliefs its planner had."""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest

from bsg_data.dataset.dataset import Dataset, read_cells
from bsg_data.errors import RecipeError
from bsg_models.search.knowledge import Knowledge, find_ways
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.search.simulator import Step
from bsg_models.studies.kept_searches import (
    KeptSearch,
    belief_changes,
    list_visits,
    walk_of,
)
from bsg_models.studies.replay import choose_shown, replay_search
from bsg_models.studies.savings import summarise
from bsg_models.studies.search_request import StudyRecipe
from bsg_models.studies.search_study import Study, study_search

WORLDS = (WorldRecipe(kind="star"), WorldRecipe(kind="tree"))
RECIPE = StudyRecipe(worlds=WORLDS, tasks=("all",), episodes=5, draws=2, planners=("ratio",))
EPISODE = 3
CORRIDOR = np.full((4, 4), np.inf)  # rooms 1 – 2 – 3 in a row, 2 m and 3 m apart
CORRIDOR[[1, 2, 2, 3], [2, 1, 3, 2]] = 2.0, 2.0, 3.0, 3.0


@pytest.fixture
def scene(dataset: Path) -> str:
    """The largest building."""
    return max(read_cells(dataset).items(), key=lambda item: len(item[1]))[0]


@pytest.fixture
def study(dataset: Path, run: Path, scene: str) -> Study:
    return study_search(dataset, {scene: run}, RECIPE, trace=EPISODE)


def step(rows: list[int], presence: list[list[float]], here: int, entered: int) -> Step:
    """Return a step towards room 3 of searches of which some go on."""
    shown = np.array(presence)[:, :, None]
    travel = find_ways(np.repeat(CORRIDOR[None], 3, axis=0))
    known = Knowledge(
        task="single",
        here=np.full(len(rows), here),
        ways=travel.costs,
        rows=np.array(rows),
        unexplored=shown[:, :, 0] > 0,
        wanted=np.ones((len(rows), 1), dtype=bool),
        presence=shown,
        share=None,
    )
    return Step(
        rows=np.array(rows),
        known=known,
        target=np.full(len(rows), 3),
        entered=np.full(len(rows), entered),
        towards=travel.steps[rows, :, 3],
    )


FIRST = step([0, 1, 2], [[0, 0, 0.2, 0.5], [0, 0, 0.2, 0.5], [0, 0, 0.9, 0.9]], 1, 2)
SECOND = step([0, 2], [[0, 0, 0, 0.8], [0, 0, 0, 0.6]], 2, 3)


def test_beliefs_change_by_the_mean_over_the_rooms_that_are_open() -> None:
    # Room 2 is entered; room 3 goes from .5 to .8, and from .9 to .6; search 1 has ended.
    np.testing.assert_allclose(belief_changes([FIRST, SECOND], 4), [0.3, 0, 0.3, 0])


def test_a_walk_by_hand() -> None:
    """Room 2 is on the way to room 3, which holds what is sought; most frequent classes first."""
    walk, cells = walk_of([FIRST, SECOND], 2), np.array([[0, 0], [0, 1], [0, 2], [1, 5]])
    assert len(walk_of([FIRST, SECOND], 1)) == 1
    visits = list_visits(walk, start=1, sought=[0], cells=cells, classes="ab", reads=True)
    start, between, end = visits
    assert (start.room, start.way, start.cost, start.target, start.leg) == (1, (), 0, 3, 5)
    assert (between.room, between.way, between.cost, between.leg) == (2, (2,), 2, 3)
    assert (end.room, end.way, end.cost, end.target, end.leg) == (3, (3,), 5, None, None)
    assert [visit.presence for visit in (start, between)] == [(0, 0.9, 0.9), (0, 0, 0.6)]
    assert end.seen == (("a", 1), ("b", 5))
    assert (start.found, between.found, end.found) == ((), (), ("a",))
    (first, *_) = list_visits(walk, start=1, sought=[0], cells=cells, classes="ab", reads=False)
    assert first.presence is None


def kept(episode: int, *, saved: float, change: float, eventful: bool = True) -> KeptSearch:
    return KeptSearch(
        scene_id="a",
        world="layout",
        task="single",
        planner="ratio",
        episode=episode,
        artifacts=("bed",),
        rooms=(1,),
        holds=(1,),
        eventful=eventful,
        change=change,
        saved=saved,
        walks={},
    )


@pytest.mark.parametrize(
    ("searches", "shown"),
    [
        # Of those within 15 points of 40 %, the one in which beliefs change most.
        ([kept(0, saved=0.4, change=0.1), kept(1, saved=0.27, change=0.2)], 1),
        ([kept(0, saved=0.4, change=0.1), kept(1, saved=0.9, change=0.2)], 0),
        # None is within 15 points: the nearest.
        ([kept(0, saved=-2, change=0.9), kept(1, saved=0.8, change=0.2)], 1),
        # An eventful one goes before a typical one.
        ([kept(0, saved=0.4, change=0.9, eventful=False), kept(1, saved=-2, change=0.1)], 1),
        # All alike: the first.
        ([kept(0, saved=0.4, change=0.1), kept(1, saved=0.4, change=0.1)], 0),
    ],
)
def test_the_search_that_is_shown_is_a_usual_one(searches: list[KeptSearch], shown: int) -> None:
    assert choose_shown(searches, 0.4).episode == shown


def test_the_walks_are_those_of_the_search_that_was_asked_for(
    dataset: Path, run: Path, scene: str, study: Study
) -> None:
    """Of both planners; keeping them changes no search."""
    first, one = study.kept
    assert (first.world, first.episode) == ("star:1-10", EPISODE)
    assert (one.world, one.task, one.planner) == ("tree:1-10", "all", "ratio")
    assert list(one.walks) == ["ratio", "nearest"]
    assert len({stops[0].room for stops in one.walks.values()}) == 1
    table = study.searches.set_index(["world", "task", "planner", "episode"])
    for planner, stops in one.walks.items():
        row = table.loc[one.world, one.task, planner, EPISODE]
        assert one.artifacts == tuple(row.artifacts)
        assert len(stops) == row.rooms_entered + 1 > 2
        assert stops[-1].cost == pytest.approx(row.cost, abs=1e-3)
        assert set(one.holds) == {stop.room for stop in stops if stop.found}
        for before, stop in pairwise(stops):
            assert stop.way[-1] == stop.room
            assert stop.cost >= before.cost
        entered = {stop.room for stop in stops}
        assert all(set(stop.way) <= entered for stop in stops)
    reading, blind = one.walks.values()
    assert all(stop.presence is None for stop in blind)
    assert any(max(stop.presence or [0]) > 0 for stop in reading)
    assert study_search(dataset, {scene: run}, RECIPE).searches.equals(study.searches)


def test_few_holders_and_many_rooms_make_a_search_eventful(
    dataset: Path, run: Path, scene: str
) -> None:
    study = study_search(dataset, {scene: run}, RECIPE, trace="auto")
    assert len(study.kept) == 2 * RECIPE.episodes
    entered = study.searches.set_index(["world", "task", "planner", "episode"]).rooms_entered
    rooms = len(Dataset.open(dataset).cells(scene)) - 2  # without the building and the start
    for one in study.kept:
        both = [entered[one.world, "all", name, one.episode] for name in ("ratio", "nearest")]
        assert one.eventful == (min(both) >= 4 and len(one.holds) <= rooms / 4)
    results = summarise(study, resamples=0)
    replay = replay_search(Dataset.open(dataset), study, results, model=None, named=False)
    assert replay.world == "star:1-10"  # the first, as none is measured
    (shown,) = [s for s in study.kept if (s.world, s.episode) == (replay.world, replay.episode)]
    assert ("but no search met the rule" in replay.chosen) == (not shown.eventful)


def test_the_means_of_all_searches_stand_beside_the_one(dataset: Path, run: Path) -> None:
    """A number is of the first building; a room that cannot be reached is not drawn."""
    scenes = sorted(read_cells(dataset))[5:8]
    study = study_search(dataset, dict.fromkeys(scenes, run), RECIPE, trace=EPISODE)
    results, first = summarise(study, resamples=0), study.kept[0]
    fewer = replace(first, rooms=first.rooms[1:])
    study = replace(study, kept=(fewer, *study.kept[1:]))
    replay = replay_search(Dataset.open(dataset), study, results, model="gamma-poisson", named=True)
    assert (replay.scene_id, replay.world, replay.episode) == (scenes[0], "star:1-10", EPISODE)
    (result,) = [one for one in results if one.world == replay.world]
    assert (replay.searches, replay.buildings) == (15, 3)
    assert [walk.planner for walk in replay.walks] == ["ratio", "nearest"]
    assert [walk.model for walk in replay.walks] == ["gamma-poisson", None]
    for walk in replay.walks:
        assert walk.mean_cost == result.savings[walk.planner].cost
        assert walk.mean_saved.value == result.savings[walk.planner].saved.value
    assert (replay.unit, replay.doors) == ("", ())  # of a drawn world they would be wrong
    assert sorted(room.number for room in replay.plan.rooms) == list(fewer.rooms)
    assert replay.left_out == 1


@pytest.mark.parametrize("trace", [5, -1])
def test_a_search_that_is_not_there_cannot_be_kept(dataset: Path, run: Path, trace: int) -> None:
    with pytest.raises(RecipeError):
        study_search(dataset, {"any": run}, RECIPE, trace=trace)
