"""Which way is up, which storey, and hulls, by hand and beside SciPy."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import ConvexHull

from bsg_data.geometry.placement import find_storeys, place_scene, surround
from bsg_data.geometry.semantic_mesh import MeshSurvey
from bsg_data.scene.scene_graph import MeshCoverage, Room, SceneGraph, SceneObject
from bsg_data.scene.surroundings import measure_area

# What x, y and z of the building are in the axes of a file in which this axis is up.
AXES = {
    "x": ((0, 0, 1), (1, 0, 0), (0, 1, 0)),
    "y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-x": ((0, 0, -1), (0, 1, 0), (1, 0, 0)),
    "-y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}
NAMES = ("floor", "ceiling", "chair", "floor", "ceiling", "book")
# Lowest and highest corner of each: two rooms side by side, the second one storey up.
BOXES = np.array(
    [
        [[0, 0, 0], [4, 3, 0]],
        [[0, 0, 2.5], [4, 3, 2.5]],
        [[1, 1, 0], [1.5, 1.5, 0.9]],
        [[5, 0, 3], [9, 3, 3]],
        [[5, 0, 5.5], [9, 3, 5.5]],
        [[0, 0, 0], [0, 0, 0]],
    ]
)


def scene() -> SceneGraph:
    objects = tuple(
        SceneObject(i, i, 1 + (i > 3), name, name, None, "left-out")
        for i, name in enumerate(NAMES, 1)
    )
    rooms = Room(1, 3), Room(2, 6)
    return SceneGraph("s", "hm3d", None, None, "0" * 64, rooms, objects, class_map="m")


def survey_in(up_axis: str) -> MeshSurvey:
    """Survey the two rooms as a file with this axis up would have them; the book has no surface."""
    turn = np.array(AXES[up_axis], dtype=float)
    boxes = np.sort(BOXES @ turn.T, axis=1)
    boxes[-1] = np.nan
    area, owner = np.array([12.0, 12, 2, 12, 12, 0]), np.arange(5)
    coverage = MeshCoverage(sha256="0" * 64)
    return MeshSurvey(area, boxes.mean(axis=1), boxes, boxes, boxes[:5], owner, coverage)


@pytest.mark.parametrize("up_axis", AXES)
def test_a_building_stands_upright_whatever_axis_points_up_in_its_file(up_axis: str) -> None:
    placed = place_scene(scene(), survey_in(up_axis))
    assert placed.up_axis == up_axis
    found = [[obj.box.minimum, obj.box.maximum] for obj in placed.objects if obj.box is not None]
    # Upright up to a turn about z, which nothing fixes: heights and sizes are what they were.
    np.testing.assert_allclose(np.array(found)[:, :, 2], BOXES[:5, :, 2], atol=1e-12)
    sizes = np.sort(np.ptp(np.array(found)[:, :, :2], axis=1), axis=1)
    np.testing.assert_allclose(sizes, np.sort(np.ptp(BOXES[:5, :, :2], axis=1), axis=1))
    assert [room.floor_index for room in placed.rooms] == [0, 1]
    assert placed.objects[-1].box is None
    assert placed.has_geometry


def test_rooms_by_hand() -> None:
    first, second = place_scene(scene(), survey_in("z")).rooms
    assert first.box is not None
    assert (first.box.minimum, first.box.maximum) == ((0, 0, 0), (4, 3, 2.5))
    assert first.centroid == (2, 1.5, 1.25)
    assert set(first.footprint or ()) == {(0, 0), (4, 0), (4, 3), (0, 3)}
    assert second.centroid == (7, 1.5, 4.25)


def test_without_floors_and_ceilings_the_standard_decides() -> None:
    graph, survey = scene(), survey_in("z")
    seen = survey.area * np.array([0, 0, 1, 0, 0, 0])
    nothing = replace(survey, area=seen, cells=survey.cells[2:3], owner=np.array([2]))
    placed = place_scene(graph, nothing)
    assert placed.up_axis == "y"
    assert placed.rooms[1].box is None


def test_storeys_by_hand() -> None:
    def levels(*floors: float | None) -> list[int | None]:
        rooms = [Room(i, i, floor_z=floor) for i, floor in enumerate(floors, 1)]
        return [room.floor_index for room in find_storeys(rooms)]

    assert levels(0.0, 0.1, -0.2, 2.9, 3.1, None, 5.8) == [0, 0, 0, 1, 1, None, 2]
    assert levels(0, 0.9, 1.8, 2.7, 3.6) == [0, 0, 0, 1, 1]  # half-landings all the way
    assert levels(None) == [None]
    assert levels() == []


def test_stairs_do_not_reach_out_of_their_room() -> None:
    graph, survey = scene(), survey_in("z")
    boxes = survey.box.copy()
    boxes[3] = [[5, 0, 0], [9, 3, 3]]  # what leads up to the upper room is annotated there
    stairs = graph.objects[3]._replace(category="stairs")
    objects = (*graph.objects[:3], stairs, *graph.objects[4:])
    survey = replace(survey, box=boxes, part_box=boxes, cells=boxes[:5])
    placed = place_scene(replace(graph, objects=objects), survey)
    upper = placed.rooms[1].box
    assert upper is not None
    assert upper.minimum[2] == 5.5  # its ceiling is all that is left of it
    assert placed.objects[3].box is not None
    assert placed.objects[3].box.minimum[2] == 0


@settings(max_examples=50)
@given(st.lists(st.tuples(st.integers(-9, 9), st.integers(-9, 9)), min_size=1, max_size=30))
def test_hulls_hold_every_point_and_turn_left(points: list[tuple[int, int]]) -> None:
    array = np.array(points, dtype=float)
    corners = np.array(surround(array))
    sides = np.roll(corners, -1, axis=0) - corners
    for point in array:
        away = point - corners
        assert (sides[:, 0] * away[:, 1] - sides[:, 1] * away[:, 0] >= -1e-9).all()
    if np.linalg.matrix_rank(array - array[0]) == 2:
        assert measure_area(corners.tolist()) == pytest.approx(ConvexHull(array).volume)
