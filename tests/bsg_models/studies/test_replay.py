"""A replay shows the search that ran: its rooms, its costs, and the beliefs its planner had."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bsg_data.dataset.dataset import read_cells
from bsg_data.errors import RecipeError
from bsg_models.rendering.explorer import View, explorer_page
from bsg_models.search.room_graphs import WorldRecipe
from bsg_models.studies.replay import replay_search
from bsg_models.studies.search_cases import StudyRecipe
from bsg_models.studies.search_steps import KeepRequest, KeptSearch
from bsg_models.studies.search_study import Searches, Study, study_search
from bsg_models.training.training import train_run
from bsg_models.zoo.config import find_config

WORLDS = (WorldRecipe(kind="star"), WorldRecipe(kind="tree"))
RECIPE = StudyRecipe(worlds=WORLDS, episodes=5, masks=2, at_once=2, planners=("ratio",))
EXPLORED = RECIPE.model_copy(update={"strategy": "explore", "withhold": 0.2, "parts": True})
EPISODE = 3


@pytest.fixture(params=["gamma-poisson", "mixture"])
def run(dataset: Path, tmp_path: Path, request: pytest.FixtureRequest) -> Path:
    list(train_run(find_config(request.param), dataset, tmp_path / "run"))
    return tmp_path / "run"


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
    (kept,) = [one for one in study.searches if one.kept is not None]
    return kept


@pytest.fixture
def kept(searches: Searches) -> KeptSearch:
    assert searches.kept is not None
    return searches.kept


@pytest.fixture
def views(dataset: Path, run: Path, kept: KeptSearch) -> list[View]:
    return replay_search(dataset, run, RECIPE, kept)


def test_the_search_that_was_asked_for_is_kept(searches: Searches, kept: KeptSearch) -> None:
    assert (kept.world, kept.task, kept.planner) == ("tree:1-10", "all", "ratio")
    assert kept.start == searches.starts[EPISODE]
    assert kept.artifacts == tuple(searches.artifacts[EPISODE])
    assert kept.draw == EPISODE % RECIPE.masks
    outcome = searches.outcomes["all", "ratio"]
    assert len(kept.steps) == outcome.entered[EPISODE] > 1
    cost = sum(step.distance[step.entered] for step in kept.steps)
    assert cost == pytest.approx(outcome.costs[EPISODE])


def test_keeping_steps_changes_no_search(
    dataset: Path, run: Path, scene: str, study: Study
) -> None:
    without = study_search(dataset, {scene: run}, RECIPE)
    for one, other in zip(study.searches, without.searches, strict=True):
        assert other.kept is None
        for key, outcome in one.outcomes.items():
            np.testing.assert_array_equal(outcome.costs, other.outcomes[key].costs)


def test_the_presence_shown_is_that_which_the_planner_was_given(
    kept: KeptSearch, views: list[View]
) -> None:
    assert len(views) == len(kept.steps) + 1
    for view, step in zip(views, kept.steps, strict=False):
        assert view.moment is not None
        shown = view.belief.presence[:, list(kept.artifacts)]
        open_ = np.ones(len(shown), dtype=bool)
        open_[[0, *view.moment.route]] = False
        np.testing.assert_allclose(shown[open_], step.presence[open_], rtol=1e-6, atol=1e-9)
        assert (step.presence[~open_] == 0).all()
        assert step.presence[open_].any()


def test_under_any_mask_the_presence_shown_is_that_which_the_planner_was_given(
    dataset: Path, run: Path, scene: str
) -> None:
    """Also in rooms that the robot had searched before, and of classes that the mask withheld."""
    keep = KeepRequest(EPISODE, "all", "ratio", world="tree:1-10")
    study = study_search(dataset, {scene: run}, EXPLORED, keep=keep)
    (kept,) = [one.kept for one in study.searches if one.kept is not None]
    views = replay_search(dataset, run, EXPLORED, kept)
    assert len(views) == len(kept.steps) + 1
    for view, step in zip(views, kept.steps, strict=False):
        assert step.presence is not None
        open_ = np.setdiff1d(np.arange(1, len(step.presence)), view.moment.route)
        shown = view.belief.presence[:, list(kept.artifacts)]
        np.testing.assert_allclose(shown[open_], step.presence[open_], atol=1e-6)


def test_the_route_ends_with_the_last_artifact(
    searches: Searches, kept: KeptSearch, views: list[View]
) -> None:
    moments = [view.moment for view in views]
    first, last = moments[0], moments[-1]
    assert first is not None
    assert last is not None
    assert last.cost == pytest.approx(searches.outcomes["all", "ratio"].costs[EPISODE])
    assert last.target is None
    assert last.route == (kept.start, *(step.entered for step in kept.steps))
    assert set(last.holds) <= set(last.route)
    assert last.route[-1] in last.holds
    assert first.legs[0] is None  # in a tree of rooms the building is out of reach
    assert '"legs":[null,' in explorer_page(views)


def test_a_robot_sees_artifacts_in_the_rooms_that_it_entered_alone(views: list[View]) -> None:
    for view in views:
        moment, partial = view.moment, view.belief.partial
        assert moment is not None
        seen = {o.room_index for o in partial.objects if o.class_index in moment.artifacts}
        assert seen == set(moment.holds) & set(moment.route)
        searched = [i for i, room in enumerate(partial.rooms, 1) if room.hidden_share == 0]
        assert sorted(moment.route) == searched


@pytest.mark.parametrize(
    ("keep", "expected"),
    [
        (KeepRequest(5, "all", "ratio"), "no search 5: a building has 5, from 0"),
        (KeepRequest(-1, "all", "ratio"), "no search -1"),
        (KeepRequest(0, "all", "oracle"), "no task 'all' with planner 'oracle'"),
    ],
)
def test_a_search_that_is_not_there_cannot_be_kept(
    dataset: Path, keep: KeepRequest, expected: str
) -> None:
    with pytest.raises(RecipeError, match=expected):
        study_search(dataset, {}, RECIPE, keep=keep)


def test_artifacts_that_the_model_placed_are_not_replayed(
    dataset: Path, run: Path, kept: KeptSearch
) -> None:
    posterior = RECIPE.model_copy(update={"truth": "posterior"})
    with pytest.raises(RecipeError, match="really there"):
        replay_search(dataset, run, posterior, kept)
