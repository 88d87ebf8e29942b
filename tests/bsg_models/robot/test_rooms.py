"""Rooms by id or label, and the hidden shares that a person says."""

from __future__ import annotations

from dataclasses import replace

import pytest
from conftest import REPOSITORY
from refusals import refuses

from bsg_data.errors import RecipeError
from bsg_data.observation.partial_graph import PartialGraph
from bsg_data.observation.robot_json import read_robot_graph
from bsg_models.robot.rooms import find_room, set_hidden_shares


@pytest.fixture
def office() -> PartialGraph:
    return read_robot_graph(REPOSITORY / "docs" / "office.json")


def test_a_room_is_found_by_id_then_by_a_label_that_it_alone_has(office: PartialGraph) -> None:
    ids = [room.name for room in office.rooms]
    assert [find_room(office, name) for name in ids] == list(range(1, len(ids) + 1))
    assert find_room(office, "b: SHARED kitchen") == ids.index("kitchen") + 1
    with refuses(RecipeError, "room-unknown", "kitchn"):
        find_room(office, "kitchn")
    alike = replace(office, rooms=tuple(replace(r, label="room") for r in office.rooms))
    with refuses(RecipeError, "room-ambiguous", "Room"):
        find_room(alike, "Room")


def test_shares_of_all_rooms_and_of_single_ones(office: PartialGraph) -> None:
    assert set_hidden_shares(office) == office
    graph = set_hidden_shares(office, every=0.4, rooms={"kitchen": 0, "C: meeting room": 1})
    shares = {room.name: (room.hidden_share, room.visited) for room in graph.rooms}
    assert shares["kitchen"] == (0, True)
    assert shares["meeting-room"] == (1, False)
    assert shares["waiting-room"] == (0.4, True)
    assert all(room.hidden_share_sd == 0 for room in graph.rooms)
    bare = replace(office, rooms=(), objects=(), adjacency=())
    assert set_hidden_shares(bare, every=0.3).hidden_share == 0.3


def test_what_is_no_share_or_no_room_is_refused(office: PartialGraph) -> None:
    for share in (1.5, -0.1, float("nan")):
        with pytest.raises(RecipeError):
            set_hidden_shares(office, rooms={"kitchen": share})
        with pytest.raises(RecipeError):
            set_hidden_shares(office, every=share)
    with refuses(RecipeError, "room-unknown", "attic"):
        set_hidden_shares(office, rooms={"attic": 0.5})
