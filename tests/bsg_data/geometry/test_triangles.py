"""Triangles worked out by hand."""

from __future__ import annotations

import numpy as np
import pytest

from bsg_data.geometry.triangles import (
    divide_triangle,
    find_longest,
    find_spans,
    measure_areas,
    split_corners,
    take_corners,
)

# Sides of 3, 4 and 5 in the plane z = 1, and the same turned into the plane x = 2.
CORNERS = np.array([[[0, 0, 1], [3, 0, 1], [0, 4, 1]], [[2, 0, 0], [2, 3, 0], [2, 0, 4]]], float)


def test_areas_sides_and_spans() -> None:
    a, b, c = split_corners(CORNERS)
    assert measure_areas(a, b, c).tolist() == [6, 6]
    assert find_longest(a, b, c).tolist() == [5, 5]
    low, high = find_spans(a, b, c)
    assert low.T.tolist() == [[0, 0, 1], [2, 0, 0]]
    assert high.T.tolist() == [[3, 4, 1], [2, 3, 4]]


def test_faces_take_their_corners_from_points() -> None:
    points, faces = CORNERS.reshape(6, 3).T, np.arange(6).reshape(2, 3).T
    for taken, split in zip(take_corners(points, faces), split_corners(CORNERS), strict=True):
        np.testing.assert_array_equal(taken, split)


@pytest.mark.parametrize("n", [1, 2, 5])
def test_a_triangle_is_divided_into_equal_ones(n: int) -> None:
    weights = divide_triangle(n, 0, n)
    assert weights.shape == (n * n, 3)
    np.testing.assert_allclose(weights.sum(axis=1), 1)
    np.testing.assert_allclose(weights.mean(axis=0), 1 / 3)
    assert (weights > 0).all()
    in_parts = np.concatenate([divide_triangle(n, row, row + 1) for row in range(n)])
    assert sorted(map(tuple, in_parts)) == sorted(map(tuple, weights))
