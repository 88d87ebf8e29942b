"""Floor plans and layouts: doorways in shared walls, a way everywhere, as DomestiGraph has them."""

from __future__ import annotations

from itertools import combinations

import networkx as nx
import numpy as np
import pytest
import yaml
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.build import build_dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.scene.scene_graph import SceneGraph
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.sources.room_layouts import WithLayouts
from bsg_data.synthetic.building import read_rooms, synthesise
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.synthetic.floor_plan import draw_floor_plan, draw_layout

SCENES = 20


@pytest.fixture(scope="module")
def built(tmp_path_factory: pytest.TempPathFactory) -> list[SceneGraph]:
    """The scene graphs of twenty buildings with their layouts, none of which is left out."""
    folder = tmp_path_factory.mktemp("synthetic")
    list(write_synthetic(folder / "buildings", scenes=SCENES, seed=4))
    source = WithLayouts(HM3DFolder(folder / "buildings"), folder / "buildings" / "layouts")
    manifest = build_dataset(source, folder / "dataset", strict=True)
    assert (manifest.totals.placed, manifest.left_out) == (SCENES, ())
    return list(read_scene_graphs(folder / "dataset"))


def test_every_room_is_placed_named_and_can_be_reached(built: list[SceneGraph]) -> None:
    for graph in built:
        rooms = nx.Graph()
        rooms.add_nodes_from(room.room_index for room in graph.rooms)
        rooms.add_edges_from((edge.source, edge.target) for edge in graph.adjacency)
        assert nx.is_connected(rooms)
        assert {edge.method for edge in graph.adjacency} <= {"layout"}
        for room in graph.rooms:
            assert room.box is not None
            assert room.floor_area
            assert room.source_label in read_rooms().kinds


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
