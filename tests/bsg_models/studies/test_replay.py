"""A replay shows the search that ran: its rooms, its costs, and the beliefs its planner had."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from pathlib import Path

import pytest

from bsg_data.dataset.dataset import Dataset, read_cells
from bsg_models.rendering.replay import Replay
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.studies.replay import LEAST_ENTERED, replay_search
from bsg_models.studies.savings import summarise
from bsg_models.studies.search_request import StudyRecipe
from bsg_models.studies.search_study import Study, study_search

WORLDS = (WorldRecipe(kind="star"), WorldRecipe(kind="tree"))
RECIPE = StudyRecipe(worlds=WORLDS, tasks=("all",), episodes=5, draws=2, planners=("ratio",))
EPISODE = 3


@pytest.fixture
def runs(dataset: Path, run: Path) -> Mapping[str, Path]:
    """Three buildings, the last of which is the largest."""
    cells = read_cells(dataset)
    return dict.fromkeys(sorted(cells, key=lambda scene: len(cells[scene]))[-3:], run)


def show(
    dataset: Path, study: Study, runs: Mapping[str, Path], trace: int | str = EPISODE
) -> Replay:
    results = summarise(study, resamples=0)
    return replay_search(
        Dataset.open(dataset), study, results, runs, model="gamma-poisson", trace=trace
    )


@pytest.mark.parametrize("world", WORLDS)
def test_the_walks_are_those_of_the_search_that_was_asked_for(
    world: WorldRecipe, dataset: Path, runs: Mapping[str, Path]
) -> None:
    """A number is of the first building. The means are those of all searches."""
    study = study_search(dataset, runs, RECIPE.model_copy(update={"worlds": (world,)}))
    shown = show(dataset, study, runs)
    assert (shown.scene_id, shown.world, shown.task) == (next(iter(runs)), world.name, "all")
    assert (shown.episode, shown.searches, shown.buildings) == (EPISODE, 15, 3)
    assert [walk.planner for walk in shown.walks] == ["ratio", "nearest"]
    assert [walk.model for walk in shown.walks] == ["gamma-poisson", None]
    assert len({walk.stops[0].room for walk in shown.walks}) == 1
    (result,) = summarise(study, resamples=0)
    table = study.searches.set_index(["scene_id", "planner", "episode"])
    for walk in shown.walks:
        row = table.loc[shown.scene_id, walk.planner, EPISODE]
        assert shown.artifacts == tuple(row.artifacts)
        assert len(walk.stops) == row.rooms_entered + 1
        assert walk.cost == pytest.approx(row.cost, abs=1e-3)
        assert set(shown.holds) == {stop.room for stop in walk.stops if stop.found}
        assert walk.mean_cost == result.savings[walk.planner].cost
        for before, stop in pairwise(walk.stops):
            assert stop.way[-1] == stop.room
            assert stop.cost >= before.cost
    reading, blind = shown.walks
    assert all(stop.presence is None for stop in blind.stops)
    assert any(max(stop.presence or [0]) > 0 for stop in reading.stops)
    assert (shown.unit, shown.doors, shown.left_out) == (
        "",
        (),
        0,
    )  # a drawn world has no metres


def test_the_first_eventful_search_is_shown(dataset: Path, runs: Mapping[str, Path]) -> None:
    """Few rooms hold what is sought, and both robots enter many; else it is the first of all."""
    study = study_search(dataset, runs, RECIPE.model_copy(update={"episodes": 40}))
    every = study.searches[study.searches.world == "star:1-10"]
    both = every[every.planner.isin(["ratio", "nearest"])]
    entered = both.groupby(["scene_id", "episode"], sort=False).rooms_entered.min()
    chance = both.groupby(["scene_id", "episode"], sort=False).chance.first()
    eventful = entered[(entered >= LEAST_ENTERED) & (chance <= 0.25)]
    replay = show(dataset, study, runs, "auto")
    expected = eventful.index[0] if len(eventful) else entered.index[0]
    assert (replay.scene_id, replay.episode) == expected
    assert ("None is eventful" in replay.chosen) == (not len(eventful))
