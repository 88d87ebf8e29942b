"""Floor areas of rooms by hand, and beside the shoelace formula."""

from __future__ import annotations

import numpy as np
import pytest

from bsg_data.geometry.floor_area import find_floor_area, measure_footprint
from bsg_data.geometry.placement import measure_area
from bsg_data.scene.scene_graph import Box

L_SHAPE = [(0.0, 0.0), (3.0, 0.0), (3.0, 1.0), (1.0, 1.0), (1.0, 2.0), (0.0, 2.0)]
BOX = Box((0, 0, 0), (3, 2, 2.5))


def test_the_first_that_says_something_counts() -> None:
    assert find_floor_area(5.5, footprint=L_SHAPE, box=BOX) == 5.5
    assert find_floor_area(None, footprint=L_SHAPE, box=BOX) == pytest.approx(4)
    assert find_floor_area(None, footprint=None, box=BOX) == 6
    assert find_floor_area(None, footprint=None, box=None) is None


@pytest.mark.parametrize("said", [0.0, -1.0, float("nan"), float("inf"), 1e6])
def test_what_no_room_can_have_is_not_said(said: float) -> None:
    assert find_floor_area(said, footprint=None, box=BOX) == 6
    assert find_floor_area(said, footprint=None, box=Box((0, 0, 0), (1e4, 1e4, 3))) is None


def test_a_shape_without_an_area_says_nothing() -> None:
    line = [(0.0, 0.0), (1.0, 1.0), (2.0, 2.0)]
    assert find_floor_area(None, footprint=line, box=BOX) == 6
    assert find_floor_area(None, footprint=line[:2], box=None) is None
    assert find_floor_area(None, footprint=None, box=Box((3, 0, 0), (1, 2, 2))) is None
    assert find_floor_area(None, footprint=None, box=Box((3, 2, 0), (1, 0, 2))) is None


def test_a_polygon_that_crosses_itself_counts_what_it_covers() -> None:
    bow = [(0.0, 0.0), (2.0, 2.0), (2.0, 0.0), (0.0, 2.0)]
    assert measure_area(bow) is None, "the two halves go opposite ways round"
    assert measure_footprint(bow) == pytest.approx(2)


def test_plain_polygons_have_the_area_of_the_shoelace_formula() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        angles = np.sort(rng.uniform(0, 2 * np.pi, 9))
        radius = rng.uniform(1, 4, (9, 1))
        star = (radius * np.stack([np.cos(angles), np.sin(angles)], axis=1)).tolist()
        corners = [(x, y) for x, y in star]
        assert measure_footprint(corners) == pytest.approx(measure_area(corners), abs=1e-3)
