"""Rooms for habitat-sim: by hand, in the keys of its example, by its rule, and of built meshes."""

from __future__ import annotations

import json
import re
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY

from bsg_data.exports.habitat import ROW
from bsg_data.geometry.placement import UPRIGHT
from bsg_data.scene.scene_graph import Box, Room, SceneGraph

EXAMPLE = REPOSITORY.parent / "shared" / "sources" / "habitat_semantic_config_example.json"
CUBE = Box((0, 0, 0), (1, 1, 1))


def regions_of(*rooms: Room) -> list[dict[str, Any]]:
    graph = SceneGraph("s", "hm3d", None, None, "0" * 64, rooms, (), class_map="hm3d45-v1")
    (data,) = ROW.encode(graph, ()).files.values()
    assert b"-0.0" not in data
    return json.loads(data)["region_annotations"]


def contains(region: dict[str, Any], point: tuple[float, float, float]) -> bool:
    """Say what habitat-sim says: by height, by bounds, and by the edges that a ray crosses."""
    x, y, z = point
    floor = region["floor_height"]
    inside = floor <= y <= floor + region["extrusion_height"]
    ends = zip(region["min_bounds"], point, region["max_bounds"], strict=True)
    inside &= all(low <= value <= high for low, value, high in ends)
    loop, odd = [(x, z) for x, _, z in region["poly_loop"]], False
    for (ax, az), (bx, bz) in zip(loop, [*loop[1:], loop[0]], strict=True):
        odd ^= (z < az) != (z < bz) and x < ax + (z - az) / (bz - az) * (bx - ax)
    return inside and odd


def test_a_room_by_hand() -> None:
    triangle = ((0.0, 1.0), (4.0, 1.0), (4.0, 3.0))
    room = Room(1, 7, label="kitchen", box=Box((0, 1, 0.5), (4, 3, 3)), footprint=triangle)
    (region,) = regions_of(room)
    assert region == {
        "name": "region_7",
        "label": "kitchen",
        "poly_loop": [[0, 0.5, -1], [4, 0.5, -1], [4, 0.5, -3]],
        "floor_height": 0.5,
        "extrusion_height": 2.5,
        "min_bounds": [0, 0.5, -3],
        "max_bounds": [4, 3, -1],
    }
    assert contains(region, (3.5, 1, -1.2))
    assert not contains(region, (0.5, 1, -2.8)), "in the bounds, outside the footprint"
    assert not contains(region, (3.5, 0.4, -1.2))


def test_a_label_is_the_common_one_else_the_source_s_else_room() -> None:
    regions = regions_of(
        Room(1, 0, source_label="k", label="kitchen", box=CUBE),
        Room(2, 1, source_label="Diele", box=CUBE),
        Room(3, 2, box=CUBE),
        Room(4, 3, source_label="nowhere"),
    )
    assert [(region["name"], region["label"]) for region in regions] == [
        ("region_0", "kitchen"),
        ("region_1", "Diele"),
        ("region_2", "room"),
    ], "a room without a box has no region"
    assert len(regions[0]["poly_loop"]) == 4, "a box stands in for a footprint"


@pytest.mark.parametrize("up_axis", UPRIGHT)
def test_the_stage_s_orientation_turns_the_mesh_file_as_we_do(up_axis: str) -> None:
    """habitat-sim turns the file's `up` to +Y and its `front` to -Z; so do our two turns."""
    graph = SceneGraph(
        *("s", "hm3d", None, None, "0" * 64, (Room(1, 0, box=CUBE),), ()),
        class_map="m",
        up_axis=up_axis,
    )
    said = re.findall(r'"(?:up|front)": (\[.*?\])', str(ROW.encode(graph, ()).note))
    up, front = (np.array(json.loads(axis)) for axis in said)
    right = np.cross(front, up)
    upright = np.array(UPRIGHT[up_axis])  # file → dataset
    ours = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) @ upright  # dataset → habitat-sim
    assert (ours @ up == (0, 1, 0)).all()
    assert (ours @ front == (0, 0, -1)).all()
    assert (ours @ right == (1, 0, 0)).all()


@pytest.mark.skipif(not EXAMPLE.is_file(), reason="no example here")
def test_keys_types_and_rule_are_those_of_habitat_sim_s_own_example() -> None:
    negative, positive = json.loads(EXAMPLE.read_bytes())["region_annotations"]
    (ours,) = regions_of(Room(1, 0, box=CUBE))
    types = [(key, type(value)) for key, value in negative.items()]
    assert [(key, type(value)) for key, value in ours.items()] == types
    # The points that habitat-sim's own test has inside and outside of them.
    assert contains(negative, (-5.1, 0.0, 0.01))
    assert contains(positive, (5.1, 0.0, 0.01))
    assert not contains(negative, (-4.9, 0.0, 0.01))
    assert not contains(positive, (-5.1, 0.0, 0.01))
