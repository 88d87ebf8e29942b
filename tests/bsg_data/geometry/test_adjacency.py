"""Doors and stairs that join rooms, by hand."""

from __future__ import annotations

from dataclasses import replace

import pytest

from bsg_data.geometry.adjacency import connect_rooms
from bsg_data.scene.scene_graph import Box, Room, SceneGraph, SceneObject

Corner = tuple[float, float, float]


def room(index: int, low: Corner, high: Corner) -> Room:
    centre = tuple((a + b) / 2 for a, b in zip(low, high, strict=True))
    footprint = ((low[0], low[1]), (high[0], low[1]), (high[0], high[1]), (low[0], high[1]))
    return Room(index, index, None, centre, Box(low, high), 0, low[2], footprint)  # type: ignore[arg-type]


def thing(index: int, room_index: int, category: str, low: Corner, high: Corner) -> SceneObject:
    box = Box(low, high)
    return SceneObject(
        index, index, room_index, category, category, None, "left-out", None, low, box, 1.0, box
    )


def graph(rooms: list[Room], *objects: SceneObject) -> SceneGraph:
    return SceneGraph("s", "hm3d", None, None, "0" * 64, tuple(rooms), objects, class_map="m")


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


@pytest.mark.parametrize(("gap", "joins"), [(0.34, True), (0.36, False)])
def test_a_door_reaches_a_slanted_room_by_its_footprint(gap: float, joins: bool) -> None:
    """The second room is a triangle: its box meets the door, its long side is `gap` away."""
    door = thing(1, 1, "door", (2, 2, 0), (3, 3, 2))
    far = 6 + gap * 2**0.5  # of its long side, x + y = far: the door's corner is at x + y = 6
    corner = room(2, (far - 4, far - 4, 0), (4, 4, 2.6))
    corner = replace(corner, footprint=((4, far - 4), (4, 4), (far - 4, 4)))
    joined = methods(connect_rooms(graph([room(1, (0, 0, 0), (3, 3, 2.6)), corner], door)))
    assert ("door" in joined.values()) == joins


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
