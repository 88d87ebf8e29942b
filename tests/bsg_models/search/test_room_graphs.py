"""Worlds, which depend on their recipe alone, and the ways in them, against networkx."""

from __future__ import annotations

import networkx
import numpy as np
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from bsg_data.errors import RecipeError
from bsg_data.scene.connections import Connections
from bsg_models.search.knowledge import find_costs, find_ways
from bsg_models.search.room_graphs import (
    DEFAULT_WORLDS,
    WorldRecipe,
    measure_rooms,
    parse_world,
    sample_travel,
)

DRAWN = ("star", "complete", "tree")


@pytest.mark.parametrize("text", ["star:1-10", "complete:5-10", "tree:0-0.5", "layout"])
def test_a_name_is_read_back(text: str) -> None:
    assert parse_world(text).name == text
    assert [parse_world(world.kind) for world in DEFAULT_WORLDS] == list(DEFAULT_WORLDS)


@pytest.mark.parametrize(
    "text", ["", "ring", "star:", "star:10-1", "star:1", "layout:1-10", "star:0-0"]
)
def test_other_texts_are_refused(text: str) -> None:
    with pytest.raises(RecipeError):
        parse_world(text)


@pytest.mark.parametrize("kind", DRAWN)
def test_travel_is_symmetric_and_does_not_depend_on_the_number_of_episodes(kind: str) -> None:
    recipe = WorldRecipe(kind=kind, low=2, high=3)  # type: ignore[arg-type]
    few, many = (
        sample_travel(recipe, nodes=8, episodes=number, scene_id="s", seed=3) for number in (2, 9)
    )
    np.testing.assert_array_equal(few.costs, many.costs[:2])
    other = sample_travel(recipe, nodes=8, episodes=2, scene_id="t", seed=3)
    assert not np.array_equal(few.costs, other.costs)
    rooms = many.costs[:, 1:, 1:]
    np.testing.assert_allclose(rooms, rooms.transpose(0, 2, 1))
    assert np.isfinite(rooms).all()
    assert rooms[:, ~np.eye(7, dtype=bool)].min() >= 2


def test_trees_are_trees() -> None:
    travel = sample_travel(WorldRecipe(kind="tree"), nodes=9, episodes=20, scene_id="s", seed=0)
    for steps in travel.steps:
        edges = [(a, b) for a in range(1, 9) for b in range(1, 9) if a != b and steps[a, b] == b]
        graph = networkx.Graph(edges)
        assert graph.number_of_edges() == 7
        assert networkx.is_tree(graph)


def test_a_layout_in_two_parts_is_its_larger_part() -> None:
    connections = Connections(
        np.array([(1, 2), (3, 4), (4, 5), (2, 3), (5, 6)]),
        np.array(["layout", "layout", "layout", "layout", "door"]),  # the last is of a mesh
        np.array([3.0, 1.0, 2.0, np.nan, 1.0]),  # one is of unknown length
    )
    graph = measure_rooms(connections, nodes=7, kind="layout")
    assert np.flatnonzero(graph.rooms).tolist() == [3, 4, 5]
    assert graph.travel(2).costs[1, 3, 5] == 3.0
    meshed = measure_rooms(connections, nodes=7, kind="geometry")
    assert np.flatnonzero(meshed.rooms).tolist() == [5, 6]
    nothing = Connections.of_pairs(())
    for nodes in (1, 7):
        assert not measure_rooms(nothing, nodes=nodes, kind="layout").rooms.any()


@pytest.mark.parametrize("method", ["door", "stairs", "boxes"])
def test_a_mesh_knows_doors_stairs_and_boxes_and_a_robot_no_lengths(method: str) -> None:
    known = Connections(np.array([(1, 2)]), np.array([method]), np.array([2.5]))
    graph = measure_rooms(known, nodes=3, kind="geometry")
    assert graph.edges[1, 2] == graph.edges[2, 1] == 2.5
    assert graph.rooms.tolist() == [False, True, True]
    assert not measure_rooms(known, nodes=3, kind="layout").rooms.any()
    given = Connections.of_pairs([(1, 2)])
    assert not measure_rooms(given, nodes=3, kind="geometry").rooms.any()


def test_the_first_wanted_room_on_the_way_by_hand() -> None:
    edges = np.full((1, 5, 5), np.inf)  # 1 – 2 – 3 – 4 in a row
    for a in (1, 2, 3):
        edges[0, a, a + 1] = edges[0, a + 1, a] = 1.0
    travel, way = find_ways(edges), (np.array([0]), np.array([1]), np.array([4]))
    for wanted, found in (([3, 4], 3), ([4], 4)):
        there = np.isin(np.arange(5), wanted)[None]
        assert travel.first_on_the_way(*way, there).tolist() == [found]


@pytest.mark.parametrize("more", [0, 100])
def test_costs_in_one_large_graph_are_scipys(more: int) -> None:
    """Of a tree of 300 rooms with further edges, some of cost 0 and some of one direction."""
    rng = np.random.default_rng(0)
    edges, rooms = np.full((301, 301), np.inf), np.arange(2, 301)
    joined = (rng.random(299) * (rooms - 1)).astype(int) + 1
    edges[rooms, joined], edges[joined, rooms] = rng.integers(0, 9, (2, 299))
    edges[tuple(rng.integers(1, 301, (2, more)))] = rng.integers(0, 9, more)
    source, target = np.nonzero(np.isfinite(edges))
    listed = csr_array((edges[source, target], (source, target)), shape=edges.shape)
    np.testing.assert_allclose(find_costs(edges), shortest_path(listed))


@pytest.mark.parametrize("share", [0.02, 0.1, 0.6])
def test_ways_in_large_graphs_are_scipys(share: float) -> None:
    """Of few edges and of many, some of cost 0; the second nodes lead to the end at that cost."""
    rng = np.random.default_rng(0)
    edges = rng.integers(0, 9, (2, 60, 60)).astype(float)
    edges[rng.random(edges.shape) > share] = np.inf
    travel = find_ways(edges)
    for one, costs, steps in zip(edges, travel.costs, travel.steps, strict=True):
        source, target = np.nonzero(np.isfinite(one))
        listed = csr_array((one[source, target], (source, target)), shape=one.shape)
        np.testing.assert_allclose(costs, shortest_path(listed))
        for start, end in rng.integers(0, 60, (100, 2)):
            place, cost, taken = int(start), 0.0, 0
            while place != end and np.isfinite(costs[start, end]):
                after = int(steps[place, end])
                place, cost, taken = after, cost + one[place, after], taken + 1
                assert taken <= 60
            assert place == end or np.isinf(costs[start, end])
            assert cost == (costs[start, end] if place == end else 0)
