"""Cells of a grid, beside loops over points and over pairs of cells."""

from __future__ import annotations

import networkx as nx
import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from bsg_data.geometry.surfaces import CELL, SurfaceCells, join_cells, keep_largest_parts

# A label and the middle of a cell, in cells.
spots = st.lists(
    st.tuples(st.integers(2, 3), *(st.integers(-2, 2) for _ in "xyz")), min_size=1, max_size=40
)


def make_cells(some: list[tuple[int, ...]]) -> SurfaceCells:
    points = (np.array([place for _, *place in some], dtype=np.float64) + 0.5) * CELL
    labels = np.array([label for label, *_ in some], np.uint16)
    return join_cells([SurfaceCells.of_points(points.T, labels, first=0)])


@given(spots)
def test_the_box_of_a_cell_is_of_its_points(some: list[tuple[int, ...]]) -> None:
    rng = np.random.default_rng(0)
    labels = np.array([label for label, *_ in some], np.uint16)
    points = rng.uniform(-0.3, 0.3, (len(some), 3))
    cells = join_cells([SurfaceCells.of_points(points.T, labels, first=0)])
    held: dict[tuple[int, ...], list[np.ndarray]] = {}
    for label, point in zip(labels.tolist(), points, strict=True):
        held.setdefault((label, *np.floor(point / CELL).astype(int)), []).append(point)
    names = sorted(held)
    np.testing.assert_array_equal(cells.low.T, [np.min(held[name], axis=0) for name in names])
    np.testing.assert_array_equal(cells.high.T, [np.max(held[name], axis=0) for name in names])
    assert (cells.keys[1:] > cells.keys[:-1]).all()


@given(spots)
def test_the_largest_part_is_that_of_a_graph_of_touching_cells(
    some: list[tuple[int, ...]],
) -> None:
    kept = keep_largest_parts(make_cells(some))
    names = sorted(set(some))
    graph = nx.Graph()
    graph.add_nodes_from(names)
    graph.add_edges_from(
        (one, other)
        for one in names
        for other in names
        if one[0] == other[0]
        and max(abs(a - b) for a, b in zip(one[1:], other[1:], strict=True)) == 1
    )
    parts = [sorted(part) for part in nx.connected_components(graph)]
    expected = []
    for label in sorted({name[0] for name in names}):
        own = [part for part in parts if part[0][0] == label]
        expected += min(own, key=lambda part: (-len(part), part[0]))  # of equal ones the first
    np.testing.assert_array_equal(kept.keys, make_cells(expected).keys)
