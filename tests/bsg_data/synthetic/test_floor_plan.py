"""Floor plans: rooms that fill a storey, doorways in shared walls, and a way everywhere."""

from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.synthetic.floor_plan import DOORWAY, WALL, draw_floor_plan

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
    graph.add_edges_from((a, b) for a, b, _ in plan.connections())
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


@settings(max_examples=60, deadline=None)
@given(rooms=st.integers(2, 30), seed=seeds)
def test_doorways_fit_into_a_wall_of_both_rooms(rooms: int, seed: int) -> None:
    plan = draw_floor_plan(rooms, with_stairs={0}, rng=np.random.default_rng(seed))
    for door in plan.doorways:
        a, b = (plan.rooms[room] for room in door.rooms)
        shared = a.grow(WALL / 2).meet(b.grow(WALL / 2))
        assert abs(shared.sides()[1 - door.axis]) < 1e-9  # the wall's own line
        assert np.isclose(door.span[1] - door.span[0], DOORWAY)
        for room in (a, b):
            assert room.low[door.axis] <= door.span[0] + 1e-9
            assert door.span[1] <= room.high[door.axis] + 1e-9
    for stairs in plan.stairs:
        lower, upper = stairs.rooms
        assert plan.storeys[upper] == plan.storeys[lower] + 1
