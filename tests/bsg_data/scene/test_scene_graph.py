from __future__ import annotations

from bsg_data.scene.scene_graph import BUILDING, Box, Edge, Room, SceneGraph, SceneObject


def test_nodes_are_the_building_then_rooms_then_objects() -> None:
    box = Box((0.0, 0.0, 0.0), (1.0, 1.0, 1.0))
    objects = (SceneObject(1, 1, 2, "bed"), SceneObject(2, 2, BUILDING, "lamp"))
    adjacency = (Edge(1, 2, "adjacent", "door", 3.0),)
    rooms = (Room(1, 10), Room(2, 20))
    bare = SceneGraph("s", "hm3d", None, None, "0" * 64, rooms, objects, adjacency, class_map="m")
    assert [(edge.source, edge.target, edge.kind) for edge in bare.edges()] == [
        (0, 1, "contains"),
        (0, 2, "contains"),
        (2, 3, "contains"),
        (0, 4, "contains"),  # of no room: the building holds it
        (1, 2, "adjacent"),
    ]
    placed = SceneObject(1, 1, 2, "bed", box=box)
    graph = SceneGraph("s", "hm3d", None, None, "0" * 64, rooms, (placed,), class_map="m")
    assert (bare.has_geometry, graph.has_geometry) == (False, True)
