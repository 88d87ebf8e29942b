"""Travel against networkx."""

from __future__ import annotations

import networkx
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from bsg_models.search.knowledge import find_ways, go_straight


@st.composite
def room_graphs(draw: st.DrawFn) -> np.ndarray[tuple[int, ...], np.dtype[np.float64]]:
    """Return edges `[3, N, N]` of graphs that may fall into parts."""
    nodes = draw(st.integers(1, 9))
    rng = np.random.default_rng(draw(st.integers(0, 2**32)))
    edges = np.where(rng.random((3, nodes, nodes)) < draw(st.floats(0, 1)), 1.0, np.inf)
    return edges * rng.uniform(0.1, 10, edges.shape)


@given(room_graphs())
def test_costs_are_those_of_networkx_and_ways_lead_there(
    edges: np.ndarray[tuple[int, ...], np.dtype[np.float64]],
) -> None:
    travel = find_ways(edges)
    for number, one in enumerate(edges):
        graph = networkx.DiGraph()
        graph.add_nodes_from(range(len(one)))
        graph.add_weighted_edges_from(
            (a, b, one[a, b]) for a, b in np.argwhere(np.isfinite(one)).tolist() if a != b
        )
        lengths = dict(networkx.all_pairs_dijkstra_path_length(graph))
        for a in range(len(one)):
            for b in range(len(one)):
                expected = lengths[a].get(b, np.inf)
                assert travel.costs[number, a, b] == pytest.approx(expected)
                if np.isfinite(expected):
                    walked, place = 0.0, a
                    while place != b:
                        following = int(travel.steps[number, place, b])
                        walked += one[place, following]
                        place = following
                    assert walked == pytest.approx(expected)


def test_the_first_wanted_room_on_the_way_by_hand() -> None:
    edges = np.full((1, 5, 5), np.inf)  # 1 – 2 – 3 – 4 in a row
    for a in (1, 2, 3):
        edges[0, a, a + 1] = edges[0, a + 1, a] = 1.0
    travel = find_ways(edges)
    wanted = np.array([[False, False, False, True, True]])
    assert travel.first_on_the_way(
        np.array([0]), np.array([1]), np.array([4]), wanted
    ).tolist() == [3]
    wanted[0, 3] = False
    assert travel.first_on_the_way(
        np.array([0]), np.array([1]), np.array([4]), wanted
    ).tolist() == [4]


def test_going_straight_takes_no_detour() -> None:
    edges = np.array([[[0, 1.0, 9.0], [1.0, 0, 1.0], [9.0, 1.0, 0]]])
    assert go_straight(edges).costs[0, 0, 2] == 9.0
    assert find_ways(edges).costs[0, 0, 2] == 2.0
    assert go_straight(edges).steps[0, 0, 2] == 2


def test_a_large_graph_has_the_ways_of_its_parts() -> None:
    """A graph beside rooms that nothing joins to it has the same ways as alone."""
    rng = np.random.default_rng(0)
    edges = np.where(rng.random((2, 20, 20)) < 0.15, rng.uniform(0, 9, (2, 20, 20)), np.inf)
    large = np.full((2, 60, 60), np.inf)
    large[:, :20, :20] = edges
    alone, among = find_ways(edges), find_ways(large)
    np.testing.assert_allclose(among.costs[:, :20, :20], alone.costs, rtol=1e-14)
    np.testing.assert_array_equal(among.steps[:, :20, :20], alone.steps)
    assert np.isinf(among.costs[:, :20, 20:]).all()
