from __future__ import annotations

from pathlib import Path

import pytest

from bsg_data.errors import RecipeError
from bsg_data.observation.robot_json import parse_robot_graph
from bsg_models.robot.room_names import find_room

ROOMS = [
    {"id": "R1", "label": "Kitchen"},
    {"id": "R2", "label": "Bedroom"},
    {"id": "R3", "label": "Bedroom"},
    {"id": "Kitchen"},
]
GRAPH = parse_robot_graph({"scene_id": "home", "rooms": ROOMS}, path=Path("graph"))


def test_an_id_comes_before_a_label() -> None:
    assert [find_room(GRAPH, name) for name in ("R1", "R3", "Kitchen")] == [1, 3, 4]


def test_a_label_names_a_room_if_no_other_has_it() -> None:
    assert find_room(GRAPH, "r2") == 2
    with pytest.raises(
        RecipeError, match=r"2 rooms are called 'bedroom'; give the id of one: R2, R3"
    ):
        find_room(GRAPH, "bedroom")
    with pytest.raises(RecipeError, match=r"2 rooms are called 'kitchen'.*R1, Kitchen"):
        find_room(GRAPH, "kitchen")


def test_an_unknown_room_is_refused_with_the_nearest() -> None:
    with pytest.raises(RecipeError, match=r"'kitchn'; did you mean Kitchen\? Rooms are R1,"):
        find_room(GRAPH, "kitchn")
    nothing = parse_robot_graph({"scene_id": "home", "rooms": []}, path=Path("graph"))
    with pytest.raises(RecipeError, match=r"no room 'x'\. Rooms are none"):
        find_room(nothing, "x")
