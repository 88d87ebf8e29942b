from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.errors import RecipeError
from bsg_data.observation.hidden_share import VAGUE, ShareBelief
from bsg_data.observation.partial_graph import KnownRoom, PartialGraph, SeenObject, observe
from bsg_data.observation.robot_json import parse_robot_graph
from bsg_data.observation.sightings import (
    GLIMPSED_SHARE,
    discover,
    enter,
    see_object,
)
from bsg_data.recipes import Exploration


def graph_of(*shares: float) -> PartialGraph:
    """Return a building whose rooms hide these shares; `cup` was seen in the first."""
    document: dict[str, Any] = {
        "scene_id": "home",
        "rooms": [
            {"id": f"r{n}", "hidden_share": share, "visited": share < 1}
            for n, share in enumerate(shares, 1)
        ],
        "objects": [{"id": "cup", "room": "r1", "category": "cup"}],
    }
    return parse_robot_graph(document, path=Path("graph"))


def test_one_more_object_leaves_the_share_of_a_room_that_was_looked_into() -> None:
    graph = graph_of(0.25, 0.75)
    sink = SeenObject("sink", 2, "sink", "sink", 0)
    after = see_object(graph, sink)
    assert after.objects == (*graph.objects, sink)
    assert after.rooms == graph.rooms
    assert after.hidden_share == graph.hidden_share
    assert len(graph.objects) == 1, "the graph that was given stays what it was"


def test_an_object_that_is_known_is_moved() -> None:
    moved = SeenObject("cup", 2, "cup", "cup", None)
    assert see_object(graph_of(0.25, 0.75), moved).objects == (moved,)


def test_a_room_in_which_something_was_seen_was_glimpsed_at_least() -> None:
    graph = see_object(graph_of(0.5, 1.0), SeenObject("sink", 2, "sink", "sink", 0))
    assert graph.rooms[1].hidden_share == GLIMPSED_SHARE
    assert not graph.rooms[1].visited
    assert graph.hidden_share == pytest.approx((0.5 + GLIMPSED_SHARE) / 2)


def test_the_share_of_a_glimpse_is_the_middle_of_those_that_models_are_trained_on() -> None:
    low, high = Exploration().glimpsed_share
    assert pytest.approx((low + high) / 2) == GLIMPSED_SHARE


@pytest.mark.parametrize(
    ("before", "said", "after"),
    [(1.0, None, VAGUE.mean), (0.2, None, 0.2), (0.2, 0.7, 0.7), (0.9, 0.0, 0.0)],
)
def test_entering_a_room_tells_what_it_hides(
    before: float, said: float | None, after: float
) -> None:
    share = None if said is None else ShareBelief(said)
    graph = enter(graph_of(before, 1.0), 1, hidden_share=share)
    assert graph.rooms[0].visited
    assert graph.rooms[0].hidden_share == after
    assert graph.hidden_share == pytest.approx((after + 1) / 2)


def test_a_building_of_which_all_was_seen_hides_what_its_rooms_do() -> None:
    assert enter(graph_of(0.0, 0.0), 2, hidden_share=ShareBelief(0.5)).hidden_share == 0.25


@given(shares=st.lists(st.floats(0.01, 1), min_size=1, max_size=5), data=st.data())
def test_searching_is_entering_with_nothing_hidden(
    shares: list[float], data: st.DataObject
) -> None:
    graph = graph_of(*shares)
    room = data.draw(st.integers(1, len(shares)))
    inside = [obj for obj in graph.objects if obj.room_index == room]
    assert enter(graph, room, hidden_share=ShareBelief(0.0)) == observe(graph, room, inside)


def test_a_new_room_is_the_last_and_beside_others() -> None:
    graph = discover(graph_of(0.25, 0.75), KnownRoom("hall", 1.0, visited=False), beside=[2, 1])
    assert [room.name for room in graph.rooms] == ["r1", "r2", "hall"]
    assert graph.adjacency == ((1, 3), (2, 3))
    assert graph.hidden_share == pytest.approx(2 / 3)


def test_what_cannot_be_is_refused() -> None:
    graph = graph_of(0.5)
    with pytest.raises(RecipeError, match=r"expected a room of 0\.\.1, found room 2"):
        see_object(graph, SeenObject("x", 2, "x", None, None))
    with pytest.raises(RecipeError, match=r"expected a room of 1\.\.1, found room 0"):
        enter(graph, 0)
    with pytest.raises(RecipeError, match="'r1' is known already"):
        discover(graph, KnownRoom("r1", 1.0))
    with pytest.raises(RecipeError, match=r"beside: expected rooms of 1..1, found \[2\]"):
        discover(graph, KnownRoom("hall", 1.0), beside=[2])
