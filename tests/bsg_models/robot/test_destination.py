from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from bsg_data.observation.robot_json import parse_robot_graph
from bsg_models.robot.ways import Ways, choose_destination, measure_ways
from bsg_models.search.planners import next_room

NOBODY = np.array([True, False, False, False, False])


def ways_of(adjacency: list[list[str]]) -> Ways:
    """Return the ways between four rooms a to d, of one step each."""
    rooms = [{"id": name} for name in "abcd"]
    document = {"scene_id": "home", "rooms": rooms, "adjacency": adjacency}
    return measure_ways(parse_robot_graph(document, path=Path("graph")))


CORRIDOR = ways_of([["a", "b"], ["b", "c"], ["c", "d"]])


def go(ways: Ways, *likely: float, explored: np.ndarray = NOBODY) -> int | None:
    presence = np.array([0.9, *likely])[:, None]
    return choose_destination(ways, here=1, explored=explored, presence=presence)


def test_a_room_on_the_way_to_a_likelier_one_is_passed_by() -> None:
    presence = np.array([0, 0, 0.01, 0.02, 0.7])
    edges = CORRIDOR.edges
    known = NOBODY | np.eye(5, dtype=bool)[1]
    assert next_room(edges, here=1, explored=known, presence=presence) == 2
    assert go(CORRIDOR, 0, 0.01, 0.02, 0.7) == 4


def test_a_likelier_room_on_the_way_is_looked_into() -> None:
    assert go(CORRIDOR, 0, 0.8, 0.02, 0.7) == 2
    assert go(CORRIDOR, 0, 0.1, 0.8, 0.7) == 3


def test_a_detour_is_not_on_the_way() -> None:
    star = ways_of([["a", "b"], ["a", "c"], ["a", "d"]])
    assert go(star, 0, 0.6, 0.7, 0.1) == 3
    corner = ways_of([["a", "b"], ["a", "c"], ["c", "d"]])
    assert go(corner, 0, 0.5, 0.0, 0.6) == 2


@pytest.mark.parametrize("left", [[], [3]])
def test_what_is_explored_is_not_gone_to(left: list[int]) -> None:
    explored = np.ones(5, dtype=bool)
    explored[left] = False
    assert go(CORRIDOR, 0, 0.5, 0.5, 0.5, explored=explored) == (left[0] if left else None)
