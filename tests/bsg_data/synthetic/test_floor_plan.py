"""Floor plans and layouts: doorways in shared walls, a way everywhere, as DomestiGraph has them."""

from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.synthetic.building import synthesise
from bsg_data.synthetic.floor_plan import draw_floor_plan, draw_layout


def test_axes_and_form_are_those_of_domestigraph() -> None:
    building = synthesise(seed=2, number=0)
    layout = yaml.safe_load(draw_layout(building, seed=2, number=0))
    assert list(layout) == ["rooms", "connections"]
    assert [room["label"] for room in layout["rooms"].values()] == [*building.rooms]
    room = layout["rooms"]["room_1"]
    assert list(room) == ["label", "centroid", "dims"]
    assert room["centroid"]["y"] % 2.9 == pytest.approx(1.3), "half of 2.6 m up, y up"
    assert room["dims"]["y"] == 2.6
    assert min(room["centroid"]["z"] for room in layout["rooms"].values()) < 0


seeds = st.integers(0, 2**32 - 1)


@settings(max_examples=60, deadline=None)
@given(rooms=st.integers(1, 40), seed=seeds, with_stairs=st.sets(st.integers(0, 39), max_size=3))
def test_any_plan_can_be_walked_and_no_room_lies_in_another(
    rooms: int, seed: int, with_stairs: set[int]
) -> None:
    listed = {room for room in with_stairs if room < rooms}
    plan = draw_floor_plan(rooms, with_stairs=listed, rng=np.random.default_rng(seed))
    graph = nx.Graph()
    graph.add_nodes_from(range(rooms))
    graph.add_edges_from(plan.connections())
    assert nx.is_connected(graph)
    assert len(plan.rooms) == len(plan.storeys) == rooms
    assert (max(plan.storeys) > 0) == bool(listed and rooms > 1)
    for a, b in combinations(range(rooms), 2):
        if plan.storeys[a] == plan.storeys[b]:
            assert min(plan.rooms[a].meet(plan.rooms[b]).sides()) <= 1e-9


@settings(max_examples=30, deadline=None)
@given(rooms=st.integers(4, 17), seed=seeds, hallway=st.integers(0, 3))
def test_a_hallway_is_the_hall_between_the_others(rooms: int, seed: int, hallway: int) -> None:
    plan = draw_floor_plan(
        rooms, with_stairs=(), hallways={hallway}, rng=np.random.default_rng(seed)
    )
    whole = max(room.high[0] for room in plan.rooms) - min(room.low[0] for room in plan.rooms)
    assert np.isclose(plan.rooms[hallway].sides()[0], whole)
