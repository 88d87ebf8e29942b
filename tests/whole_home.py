"""A whole building, written out by hand: two rooms with a door, a chair, and a thing in no room."""

from __future__ import annotations

from bsg_data.scene.scene_graph import Box, Edge, Room, SceneGraph, SceneObject

CLASSES = ("bed", "chair")
HOME = SceneGraph(
    "home 1",
    "hm3d",
    None,
    None,
    "0" * 64,
    rooms=(
        Room(
            1,
            4,
            "Küche",
            (1.0, 2.0, 1.5),
            floor_index=0,
            footprint=((0.0, 0.0), (4.0, 0.0), (4.0, 3.0)),
            label="kitchen",
        ),
        Room(2, 9),
    ),
    objects=(
        SceneObject(1, 3, 2, "Chair", "chair", 1, "classified", box=Box((0, 0, 0), (1, 2, 3))),
        SceneObject(2, 8, 0, ""),
        SceneObject(3, 9, 2, "clock", "clock", role="left-out", area=0.5),
    ),
    adjacency=(Edge(1, 2, "adjacent", "door", 3.5),),
    class_map="hm3d45-v1",
    building_kind="home",
)
