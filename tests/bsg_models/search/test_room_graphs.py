"""Worlds, which depend on their recipe alone, and the ways in them, against SciPy."""

from __future__ import annotations

import networkx
import numpy as np
import numpy.typing as npt
import pytest
from scipy.sparse import csr_array
from scipy.sparse.csgraph import shortest_path

from bsg_data.errors import RecipeError
from bsg_data.scene.connections import Connections
from bsg_models.search.knowledge import find_costs, find_ways
from bsg_models.search.room_graphs import (
    DEFAULT_WORLDS,
    WorldRecipe,
    measure_travel,
    parse_world,
    sample_travel,
)

DRAWN = ("star", "complete", "tree")


def test_a_name_is_read_back_and_other_texts_are_refused() -> None:
    for text in ("star:1-10", "complete:5-10", "tree:0-0.5", "layout"):
        assert parse_world(text).name == text
    assert [parse_world(world.kind) for world in DEFAULT_WORLDS] == list(DEFAULT_WORLDS)
    for text in ("", "ring", "star:", "star:10-1", "star:1", "layout:1-10", "star:0-0"):
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
        np.array(["layout", "layout", "layout", "layout", "stairs"]),  # the last is of a mesh
        np.array([3.0, 1.0, 2.0, np.nan, 1.0]),  # one is of unknown length
    )
    travel, rooms = measure_travel(connections, nodes=7, episodes=2, kind="layout")
    assert np.flatnonzero(rooms).tolist() == [3, 4, 5]
    assert travel.costs[1, 3, 5] == 3.0
    _, meshed = measure_travel(connections, nodes=7, episodes=2, kind="geometry")
    assert np.flatnonzero(meshed).tolist() == [5, 6]
    for nodes in (1, 7):
        nothing = Connections.of_pairs(())
        assert not measure_travel(nothing, nodes=nodes, episodes=2, kind="layout")[1].any()


def sample_edges(seed: int, nodes: int, share: float) -> npt.NDArray[np.float64]:
    """Return a tree of rooms and further edges, some of cost 0 and some of one direction."""
    rng = np.random.default_rng(seed)
    edges, rooms = np.full((nodes, nodes), np.inf), np.arange(2, nodes)
    joined = (rng.random(nodes - 2) * (rooms - 1)).astype(int) + 1
    edges[rooms, joined], edges[joined, rooms] = rng.integers(0, 9, (2, nodes - 2))
    more = rng.random(edges.shape) < share
    edges[more] = rng.integers(0, 9, more.sum())
    return edges


@pytest.mark.parametrize(("nodes", "share"), [(300, 0.0), (300, 0.001), (60, 0.05), (60, 0.6)])
def test_ways_are_scipys(nodes: int, share: float) -> None:
    """The second nodes lead to the end at that cost."""
    edges = sample_edges(0, nodes, share)
    source, target = np.nonzero(np.isfinite(edges))
    listed = csr_array((edges[source, target], (source, target)), shape=edges.shape)
    least = shortest_path(listed)
    np.testing.assert_allclose(find_costs(edges), least)
    travel = find_ways(edges[None])
    np.testing.assert_allclose(travel.costs[0], least)
    for start, end in np.random.default_rng(1).integers(1, nodes, (100, 2)).tolist():
        place, cost, taken = start, 0.0, 0
        while place != end:
            after = int(travel.steps[0, place, end])
            place, cost, taken = after, cost + edges[place, after], taken + 1
            assert taken <= nodes
        assert cost == least[start, end]
