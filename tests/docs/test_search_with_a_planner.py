"""The class of docs/examples/search_with_a_planner.py, which users copy."""

from __future__ import annotations

import itertools
import math
import runpy
from typing import Any

import pytest
from conftest import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_models.belief.expectation import Expectation
from bsg_models.belief.partial_graph import PartialGraph
from bsg_models.runs.predictor import Predictor
from bsg_robot.answers.seen_building import SeenBuilding
from bsg_robot.graph.robot_json import read_robot_graph

GRAPH = read_robot_graph(REPOSITORY / "docs" / "office.json")
EXAMPLE = REPOSITORY / "docs" / "examples" / "search_with_a_planner.py"
FindProbability = runpy.run_path(str(EXAMPLE))["FindProbability"]
FAST = Predictor("mixture")  # loaded once: it answers by counting
PLACES: dict[str, str | None] = {
    "counter": "kitchen",
    "shelf_2": "kitchen",
    "sofa": "waiting-room",
    "start_loc": None,
}


@pytest.fixture
def seen() -> SeenBuilding:
    return SeenBuilding(GRAPH, FAST)


def in_room(seen: SeenBuilding, room: str, thing: str) -> float:
    return next(place.unseen for place in seen.where(thing) if place.room == room)


@given(st.lists(st.floats(0.1, 10), min_size=1, max_size=5))
def test_a_room_holds_none_exactly_if_no_location_does(sizes: list[float]) -> None:
    seen = SeenBuilding(GRAPH, FAST)
    named = {f"place_{k}": size for k, size in enumerate(sizes)}
    probability = FindProbability(seen, dict.fromkeys(named, "kitchen"), sizes=named)
    none = math.prod(1 - probability("r1", name, "plate") for name in named)
    assert none == pytest.approx(1 - in_room(seen, "kitchen", "plate"))
    shares = sum(probability("r1", name, "bottle") for name in named)  # one was seen there
    assert shares == pytest.approx(1)


def test_a_location_that_was_searched_has_nothing_more(seen: SeenBuilding) -> None:
    probability = FindProbability(seen, PLACES, sizes={"counter": 3})
    before = seen.graph.rooms[1].hidden_share
    probability.searched("counter")
    assert probability("r1", "counter", "sink") == 0
    assert seen.graph.rooms[1].hidden_share == pytest.approx(before / 4)
    left = probability("r1", "shelf_2", "sink")
    assert left == pytest.approx(in_room(seen, "kitchen", "sink"))
    probability.searched("counter")  # told twice, counted once
    assert seen.graph.rooms[1].hidden_share == pytest.approx(before / 4)
    probability.searched("shelf_2")
    assert seen.graph.rooms[1].hidden_share == 0
    assert probability("r1", "shelf_2", "sink") == 0


def test_what_was_found_is_where_it_was_found(seen: SeenBuilding) -> None:
    probability = FindProbability(seen, PLACES)
    probability.searched("counter", ["microwave", "cup_3", "cup_4"])
    assert probability("r1", "counter", "microwave") == 1
    assert probability("r1", "shelf_2", "microwave") == 0
    assert probability("r1", "counter", "cup_3") == 1
    assert probability("r1", "sofa", "cup_3") == 0
    assert probability("r1", "counter", "cup") == 1  # any of them
    another = probability("r1", "shelf_2", "cup_5")
    assert another == pytest.approx(in_room(seen, "kitchen", "cup"))
    assert 0 < another < 1
    assert {obj.name for obj in seen.graph.objects} >= {"microwave", "cup_3", "cup_4"}


def test_only_a_robot_may_be_elsewhere(seen: SeenBuilding) -> None:
    probability = FindProbability(seen, PLACES)
    assert probability("r1", "r2_loc", "sink") == 0, "on its way"
    with pytest.raises(KeyError, match="attic"):
        probability("r1", "attic", "sink")
    with pytest.raises(ValueError, match="start_loc"):
        probability.searched("start_loc")


def test_names_of_the_planner_can_be_any(seen: SeenBuilding) -> None:
    probability = FindProbability(seen, PLACES, words={"goal": "sink"})
    assert probability("r1", "counter", "goal") == probability("r1", "counter", "sink")
    assert probability("r1", "counter", "sink_17") == probability("r1", "counter", "sink")
    with refuses(RecipeError, "thing-unknown", "zzqx"):
        probability("r1", "counter", "zzqx")
    careless = FindProbability(seen, PLACES, otherwise=0.1)
    assert careless("r1", "counter", "zzqx") == 0.1
    careless.searched("counter")
    assert careless("r1", "counter", "zzqx") == 0


def test_a_planning_loop_asks_the_model_once_a_state(
    seen: SeenBuilding, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As railroad grounds its actions: every robot, location and thing, p and 1 − p."""
    asked: list[tuple[PartialGraph, ...]] = []
    answer = Predictor.__call__

    def count(predictor: Predictor, *graphs: PartialGraph, **options: Any) -> Expectation:
        asked.append(graphs)
        return answer(predictor, *graphs, **options)

    monkeypatch.setattr(Predictor, "__call__", count)
    locations = [f"place_{k}" for k in range(9)]
    probability = FindProbability(seen, dict.fromkeys(locations, "kitchen"))
    things = [f"{word}_{k}" for k in range(5) for word in ("sink", "plant", "lamp", "tv")]
    for told in range(1, 3):
        for _ in range(2):
            for robot, location, thing in itertools.product(("r1", "r2"), locations, things):
                assert 0 <= probability(robot, location, thing) <= 1
        assert len(asked) == told
        probability.searched(locations[told])
