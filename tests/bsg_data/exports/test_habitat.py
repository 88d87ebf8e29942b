"""Rooms for habitat-sim: by hand, in the keys of its example, by its rule, and of built meshes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from painted_meshes import Painting, write_painted

from bsg_data.build import build_dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.exports.catalogue import export_dataset
from bsg_data.exports.habitat import _encode_regions, _find_orientation
from bsg_data.geometry.placement import STAIRS, UPRIGHT
from bsg_data.scene.scene_graph import Box, Room, SceneGraph
from bsg_data.sources.hm3d import HM3DFolder

EXAMPLE = REPOSITORY.parent / "shared" / "sources" / "habitat_semantic_config_example.json"
CUBE = Box((0, 0, 0), (1, 1, 1))


def regions_of(*rooms: Room) -> list[dict[str, Any]]:
    graph = SceneGraph("s", "hm3d", None, None, "0" * 64, rooms, (), class_map="hm3d45-v2")
    (data,) = _encode_regions(graph).files.values()
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
    up, front = (np.array(axis) for axis in _find_orientation(up_axis))
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


def test_regions_of_built_meshes_are_where_the_truth_says(tmp_path: Path) -> None:
    write_painted(tmp_path / "places", scenes=2, seed=5, painting=Painting(up_axis="z"))
    build_dataset(HM3DFolder(tmp_path / "places"), tmp_path / "dataset")
    done = export_dataset(tmp_path / "dataset", tmp_path / "out", to="habitat")
    graphs = list(read_scene_graphs(tmp_path / "dataset"))
    assert (done.scenes, done.rooms) == (2, sum(len(graph.rooms) for graph in graphs))
    for graph in graphs:
        text = (tmp_path / "out" / f"{graph.scene_id}.semantic_config.json").read_text()
        regions = json.loads(text)["region_annotations"]
        (file,) = (tmp_path / "places").rglob(f"{graph.scene_id.partition('-')[2]}.truth.json")
        truth = json.loads(file.read_text())
        for room, region in zip(graph.rooms, regions, strict=True):
            low, high = true_box(graph, room, truth)  # Z up
            assert region["min_bounds"] == pytest.approx((low[0], low[2], -high[1]), abs=0.021)
            assert region["max_bounds"] == pytest.approx((high[0], high[2], -low[1]), abs=0.021)
            middle = (low + high) / 2
            assert contains(region, (middle[0], middle[2], -middle[1]))


def true_box(graph: SceneGraph, room: Room, truth: Any) -> tuple[np.ndarray, np.ndarray]:
    """Return the box around what the truth says of a room's objects, without stairs and specks."""
    boxes = [
        truth["instances"][str(obj.instance_id)]["main_box"]
        for obj in graph.objects
        if obj.room_index == room.room_index
        and obj.category not in STAIRS
        and str(obj.instance_id) in truth["instances"]
    ]
    ends = np.array([box for box in boxes if box is not None])
    return ends[:, 0].min(axis=0), ends[:, 1].max(axis=0)
