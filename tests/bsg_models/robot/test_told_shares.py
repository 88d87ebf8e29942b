"""Shares that a person tells of a graph's rooms."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest
from conftest import REPOSITORY

from bsg_data.errors import RecipeError
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import read_robot_graph
from bsg_models.robot.told_shares import tell_shares


@pytest.fixture
def office() -> PartialGraph:
    return read_robot_graph(REPOSITORY / "docs" / "office.json")


def shares_of(graph: PartialGraph) -> list[tuple[float, bool]]:
    return [(room.hidden_share, room.visited) for room in graph.rooms]


def test_rooms_are_told_by_id_and_label_or_all_at_once(office: PartialGraph) -> None:
    assert tell_shares(office) == office
    told = tell_shares(office, every=0.4, rooms={"kitchen": 0, "C: meeting room": 1})
    assert shares_of(told) == [(0.4, True), (0, True), (1, False)]
    assert told.hidden_share == pytest.approx(1.4 / 3)
    assert told.objects == office.objects
    assert shares_of(tell_shares(told, rooms={"meeting-room": 0.5})) == [
        (0.4, True),
        (0, True),
        (0.5, False),
    ]


def test_a_building_without_rooms_is_told(office: PartialGraph) -> None:
    bare = replace(office, rooms=(), objects=(), adjacency=())
    assert tell_shares(bare, every=0.3).hidden_share == 0.3


def test_what_is_no_share_or_no_room_is_named(office: PartialGraph) -> None:
    wrong: tuple[Any, ...] = (-0.1, 1.5, math.nan, "x", True, 10**400)
    for share in wrong:
        with pytest.raises(RecipeError, match="hidden share of kitchen: expected 0 to 1, found"):
            tell_shares(office, rooms={"kitchen": share})
        with pytest.raises(RecipeError, match="hidden share of every room: expected 0 to 1, found"):
            tell_shares(office, every=share)
    listed: Any = [("kitchen", 0.5)]
    with pytest.raises(RecipeError, match=r"mapping of rooms to shares, found \[\('kitchen'"):
        tell_shares(office, rooms=listed)
    with pytest.raises(RecipeError, match="no room 'attic'"):
        tell_shares(office, rooms={"attic": 0.5})
