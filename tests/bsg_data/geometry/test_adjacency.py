"""Doors and stairs that join rooms, by hand, and the distance of polygons beside a dense loop."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from bsg_data.geometry.adjacency import connect_rooms, separate
from bsg_data.geometry.placement import surround
from bsg_data.scene.scene_graph import Box, Room, SceneGraph, SceneObject

Corner = tuple[float, float, float]


def room(index: int, low: Corner, high: Corner) -> Room:
    centre = tuple((a + b) / 2 for a, b in zip(low, high, strict=True))
    footprint = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
    return Room(index, index, None, centre, Box(low, high), 0, low[2], footprint)  # type: ignore[arg-type]


def thing(index: int, room_index: int, category: str, low: Corner, high: Corner) -> SceneObject:
    box = Box(low, high)
    return SceneObject(index, index, room_index, category, category, None, None, low, box, 1.0, box)


def graph(rooms: list[Room], *objects: SceneObject) -> SceneGraph:
    return SceneGraph("s", "hm3d", None, None, "0" * 64, tuple(rooms), objects)


# Three rooms in a row, walls of 12 cm, and one far away.
ROW = [
    room(1, (0, 0, 0), (3, 3, 2.6)),
    room(2, (3.12, 0, 0), (6, 3, 2.6)),
    room(3, (6.12, 0, 0), (9, 3, 2.6)),
    room(4, (30, 0, 0), (33, 3, 2.6)),
]


def methods(found: SceneGraph) -> dict[tuple[int, int], str]:
    return {(edge.source, edge.target): edge.method for edge in found.adjacency}


def test_a_door_joins_its_room_with_the_one_behind_it() -> None:
    door = thing(1, 2, "door", (3.12, 1, 0), (3.12, 1.9, 2))
    found = connect_rooms(graph(ROW, door))
    assert methods(found)[1, 2] == "door"
    edge = found.adjacency[0]
    assert edge.distance_m == pytest.approx(3.06)
    assert (edge.kind, edge.source, edge.target) == ("adjacent", 1, 2)


@pytest.mark.parametrize(
    "door",
    [
        thing(1, 2, "cabinet door", (3.12, 1, 0), (3.12, 1.9, 2)),  # of a cupboard
        thing(1, 4, "door", (30, 1, 0), (30, 1.9, 2)),  # to the outside
        thing(1, 2, "door", (3.12, 1, 2.2), (3.12, 1.9, 2.6)),  # a hatch under the ceiling
    ],
)
def test_what_is_no_way_through_joins_nothing(door: SceneObject) -> None:
    assert "door" not in methods(connect_rooms(graph(ROW, door))).values()


def test_without_doors_boxes_decide() -> None:
    found = methods(connect_rooms(graph(ROW)))
    assert set(found.values()) == {"boxes"}
    assert all(4 not in pair for pair in found)


@pytest.mark.parametrize("owner", [1, 2])
def test_stairs_join_the_rooms_at_their_ends(owner: int) -> None:
    lower, upper = room(1, (0, 0, 0), (4, 4, 2.6)), room(2, (0, 0, 2.9), (4, 4, 5.5))
    floors = [
        thing(1, 1, "floor", (0, 0, 0), (4, 4, 0)),
        thing(2, 2, "floor", (0, 0, 2.9), (4, 4, 2.9)),
    ]
    stairs = thing(3, owner, "stairs", (1, 1, 0), (4, 2, 2.9))
    found = methods(connect_rooms(graph([lower, upper], *floors, stairs)))
    assert found == {(1, 2): "stairs"}


def test_a_room_without_geometry_stays_alone() -> None:
    found = connect_rooms(graph([*ROW, Room(5, 5)]))
    assert all(5 not in (edge.source, edge.target) for edge in found.adjacency)
    assert connect_rooms(graph([Room(1, 1)])).adjacency == ()


@settings(max_examples=40, deadline=None)
@given(seed=st.integers(0, 2**32 - 1), shift=st.floats(-4, 4))
def test_the_distance_of_polygons_is_that_of_their_nearest_points(seed: int, shift: float) -> None:
    rng = np.random.default_rng(seed)
    one, other = (np.array(surround(rng.uniform(0, 2, (6, 2)))) for _ in range(2))
    other = other + np.array([shift, shift / 2])
    spots = [fill(polygon) for polygon in (one, other)]
    nearest = np.linalg.norm(spots[0][:, None] - spots[1][None], axis=2).min()
    found = separate(one, other)
    assert found <= nearest + 1e-9
    assert nearest - found < 0.25  # as dense as the points are
    assert found == pytest.approx(separate(other, one))


def fill(polygon: np.ndarray) -> np.ndarray:
    """Return points of a convex polygon: of its sides, and on the way to its middle."""
    step = np.linspace(0, 1, 12)[:, None]
    sides = [a + step * (b - a) for a, b in zip(polygon, np.roll(polygon, -1, axis=0), strict=True)]
    edge = np.concatenate(sides)
    middle = polygon.mean(axis=0)
    return np.concatenate([middle + k * (edge - middle) for k in np.linspace(0, 1, 8)])
