from __future__ import annotations

import pytest

from bsg_data.scene.scene_graph import Box, Edge, Room, SceneGraph, SceneObject, split_scene_id

BOX = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))


def graph(*objects: SceneObject, rooms: int = 2) -> SceneGraph:
    listed = tuple(Room(i, 10 * i) for i in range(1, rooms + 1))
    adjacency = (Edge(1, 2, "adjacent", "door", 3.0),)
    return SceneGraph("s", "hm3d", None, None, "0" * 64, listed, objects, adjacency, class_map="m")


def thing(index: int, room: int, box: Box | None = None) -> SceneObject:
    return SceneObject(index, index, room, "bed", "bed", None, "left-out", box=box)


def test_nodes_are_the_building_then_rooms_then_objects() -> None:
    edges = list(graph(thing(1, 2), thing(2, SceneObject.BUILDING)).edges())
    assert [(edge.source, edge.target, edge.kind) for edge in edges] == [
        (0, 1, "contains"),
        (0, 2, "contains"),
        (2, 3, "contains"),
        (0, 4, "contains"),  # of no room: the building holds it
        (1, 2, "adjacent"),
    ]


def test_one_box_is_geometry() -> None:
    assert not graph(thing(1, 1)).has_geometry
    assert graph(thing(1, 1), thing(2, 1, BOX)).has_geometry


@pytest.mark.parametrize(
    ("scene_id", "number", "building"),
    [
        ("00006-HkseAnWCgqk", 6, "HkseAnWCgqk"),
        ("HkseAnWCgqk", None, "HkseAnWCgqk"),
        ("00006-a-b", 6, "a-b"),
        ("6-HkseAnWCgqk", None, "6-HkseAnWCgqk"),
        ("00006-", None, "00006-"),
        ("240101-office", None, "240101-office"),
        ("1234567-HkseAnWCgqk", 1234567, "HkseAnWCgqk"),
    ],
)
def test_a_number_has_five_digits_and_a_hash_behind_it(
    scene_id: str, number: int | None, building: str
) -> None:
    assert split_scene_id(scene_id) == (number, building)
