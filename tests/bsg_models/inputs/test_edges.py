from __future__ import annotations

import doctest

import numpy as np
import pytest
from one_building import observe_building

from bsg_data.observation.observation import stack
from bsg_models.inputs import edges as edges_module
from bsg_models.inputs.edges import (
    EdgeSet,
    connect,
    edges_of,
)


def test_doctests() -> None:
    assert doctest.testmod(edges_module).attempted == 1
    assert doctest.testmod(edges_module).failed == 0


def test_edges_by_hand() -> None:
    assert connect(3, ("up",)).tolist() == [[1, 2], [0, 0]]
    assert connect(3, ("down",)).tolist() == [[0, 0], [1, 2]]
    assert connect(3, ("up", "down")).tolist() == [[0, 0, 1, 2], [1, 2, 0, 0]]
    assert connect(4, ("adjacent",), adjacent=[(1, 3)]).tolist() == [[1, 3], [3, 1]]
    assert connect(4, ("complete",)).shape == (2, 6)
    assert connect(1, ("up", "down")).shape == (2, 0)
    assert connect(3, ()).shape == (2, 0)
    for edges in (connect(3, ("up",)), connect(1, ("up",)), connect(3, ())):
        assert edges.dtype == np.int64


def test_an_edge_that_two_sets_have_is_there_once() -> None:
    both = connect(4, ("adjacent", "complete"), adjacent=[(1, 2), (2, 1)])
    assert both.tolist() == connect(4, ("complete",)).tolist()


def test_the_edges_of_two_buildings_by_hand() -> None:
    """Three nodes, then one without rooms, then four: rows 0 to 2, 3, and 4 to 7."""
    seen = stack(
        [
            observe_building([[0]] * 3, connected=[(1, 2)]),
            observe_building([[0]]),
            observe_building([[0]] * 4, connected=[(1, 3)]),
        ]
    )
    assert edges_of(seen, ("up",)).tolist() == [[1, 2, 5, 6, 7], [0, 0, 4, 4, 4]]
    assert edges_of(seen, ("adjacent",)).tolist() == [[1, 2, 5, 7], [2, 1, 7, 5]]
    assert edges_of(seen, ()).shape == (2, 0)
    assert edges_of(seen.take([1]), ("up", "down", "complete")).shape == (2, 0)


@pytest.mark.parametrize("edges", [("up", "down"), ("complete",), ("down", "adjacent"), ()])
def test_a_building_has_the_same_edges_alone_and_among_others(edges: tuple[EdgeSet, ...]) -> None:
    parts = [
        observe_building([[0]] * nodes, connected=[(1, nodes - 1)] if nodes > 2 else [])
        for nodes in (4, 1, 6, 2, 3)
    ]
    together = stack(parts)
    expected = [
        part + first
        for part, first in zip(
            (connect(len(p.inputs), edges, adjacent=p.connections.pairs.tolist()) for p in parts),
            together.starts.tolist(),
            strict=False,
        )
    ]
    assert edges_of(together, edges).tolist() == np.concatenate(expected, axis=1).tolist()
    backwards = together.take([4, 3, 2, 1, 0])
    assert edges_of(backwards.take([4, 3, 2, 1, 0]), edges).tolist() == (
        edges_of(together, edges).tolist()
    )
