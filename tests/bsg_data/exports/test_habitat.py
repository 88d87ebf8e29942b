"""Rooms for habitat-sim: by hand, against its example and its rule, and against built meshes."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from conftest import REPOSITORY
from hypothesis import given
from hypothesis import strategies as st
from pydantic import ValidationError

from bsg_data.build import build_dataset
from bsg_data.dataset.shards import read_scene_graphs
from bsg_data.exports.catalogue import EXPORTS
from bsg_data.exports.export import export_dataset
from bsg_data.exports.habitat import (
    Region,
    decode_regions,
    encode_regions,
    find_orientation,
    list_regions,
)
from bsg_data.geometry.gltf import read_parts
from bsg_data.geometry.placement import STAIRS, UPRIGHT
from bsg_data.scene.scene_graph import Box, Room, SceneGraph
from bsg_data.sources.hm3d import HM3DFolder
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.synthetic.geometry import GeometryOptions

EXAMPLE = REPOSITORY.parent / "shared" / "sources" / "habitat_semantic_config_example.json"
# What habitat-sim's own example says of a region, and in which words.
KEYS = {
    "name": str,
    "label": str,
    "poly_loop": list,
    "floor_height": float,
    "extrusion_height": float,
    "min_bounds": list,
    "max_bounds": list,
}


def scene(*rooms: Room, up_axis: str | None = "z") -> SceneGraph:
    return SceneGraph(
        "s", "hm3d", None, None, "0" * 64, rooms, (), up_axis=up_axis, class_map="hm3d45-v2"
    )


def contains(region: Region, point: tuple[float, float, float]) -> bool:
    """Say what habitat-sim says: by height, by bounds, and by the edges that a ray crosses."""
    x, y, z = point
    inside = region.floor_height <= y <= region.floor_height + region.extrusion_height
    ends = zip(region.min_bounds, point, region.max_bounds, strict=True)
    inside &= all(low <= value <= high for low, value, high in ends)
    loop, odd = [(x, z) for x, _, z in region.poly_loop], False
    for (ax, az), (bx, bz) in zip(loop, [*loop[1:], loop[0]], strict=True):
        odd ^= (z < az) != (z < bz) and x < ax + (z - az) / (bz - az) * (bx - ax)
    return inside and odd


def test_a_room_by_hand() -> None:
    triangle = ((0.0, 1.0), (4.0, 1.0), (4.0, 3.0))
    room = Room(1, 7, label="kitchen", box=Box((0, 1, 0.5), (4, 3, 3)), footprint=triangle)
    (region,) = list_regions(scene(room))
    assert region == Region(
        name="region_7",
        label="kitchen",
        poly_loop=((0, 0.5, -1), (4, 0.5, -1), (4, 0.5, -3)),
        floor_height=0.5,
        extrusion_height=2.5,
        min_bounds=(0, 0.5, -3),
        max_bounds=(4, 3, -1),
    )
    assert contains(region, (3.5, 1, -1.2))
    assert not contains(region, (0.5, 1, -2.8)), "in the bounds, outside the footprint"
    assert not contains(region, (3.5, 0.4, -1.2))


def test_a_label_is_the_common_one_else_the_source_s_else_room() -> None:
    box = Box((0, 0, 0), (1, 1, 1))
    rooms = (
        Room(1, 0, source_label="k", label="kitchen", box=box),
        Room(2, 1, source_label="Diele", box=box),
        Room(3, 2, box=box),
        Room(4, 3, source_label="nowhere"),
    )
    regions = list_regions(scene(*rooms))
    assert [(region.name, region.label) for region in regions] == [
        ("region_0", "kitchen"),
        ("region_1", "Diele"),
        ("region_2", "room"),
    ], "a room without a box has no region"
    assert len(regions[0].poly_loop) == 4, "a box stands in for a footprint"


def test_zero_is_never_negative() -> None:
    (region,) = list_regions(scene(Room(1, 0, box=Box((0, 0, 0), (1, 1, 1)))))
    assert "-0.0" not in encode_regions((region,)).decode()


@pytest.mark.parametrize("up_axis", UPRIGHT)
def test_the_stage_s_orientation_turns_the_mesh_file_as_we_do(up_axis: str) -> None:
    """habitat-sim turns the file's `up` to +Y and its `front` to -Z; so do our two turns."""
    up, front = (np.array(axis) for axis in find_orientation(up_axis))
    right = np.cross(front, up)
    upright = np.array(UPRIGHT[up_axis])  # file → dataset
    ours = np.array([[1, 0, 0], [0, 0, 1], [0, -1, 0]]) @ upright  # dataset → habitat-sim
    assert (ours @ up == (0, 1, 0)).all()
    assert (ours @ front == (0, 0, -1)).all()
    assert (ours @ right == (1, 0, 0)).all()
    if up_axis == "y":
        assert (ours == np.eye(3)).all(), "a file with Y up stays in its own axes"


metres = st.floats(-1e4, 1e4)
places = st.tuples(metres, metres, metres)
regions = st.builds(
    Region,
    name=st.text(max_size=9),
    label=st.text(max_size=9),
    poly_loop=st.lists(places, min_size=3, max_size=6).map(tuple),
    floor_height=metres,
    extrusion_height=st.floats(0, 1e4),
    min_bounds=places,
    max_bounds=places,
)


@given(st.lists(regions, max_size=3).map(tuple))
def test_writing_and_reading_are_inverse(written: tuple[Region, ...]) -> None:
    assert decode_regions(encode_regions(written)) == written


def test_what_is_written_has_the_keys_and_types_of_the_format() -> None:
    box = Box((0, 0, 0), (2, 3, 2.5))
    text = encode_regions(list_regions(scene(Room(1, 0, box=box))))
    (region,) = json.loads(text)["region_annotations"]
    assert {key: type(value) for key, value in region.items()} == KEYS
    assert all(len(point) == 3 for point in region["poly_loop"])
    assert all(point[1] == region["floor_height"] for point in region["poly_loop"])


@pytest.mark.parametrize("key", KEYS)
def test_a_region_without_one_of_its_keys_is_refused(key: str) -> None:
    text = encode_regions(list_regions(scene(Room(1, 0, box=Box((0, 0, 0), (1, 1, 1))))))
    config = json.loads(text)
    del config["region_annotations"][0][key]
    with pytest.raises(ValidationError, match=key):
        decode_regions(json.dumps(config).encode())


@pytest.mark.skipif(not EXAMPLE.is_file(), reason="no example here")
def test_habitat_sim_s_own_example_goes_round() -> None:
    data = EXAMPLE.read_bytes()
    negative, positive = decode_regions(data)
    assert json.loads(encode_regions((negative, positive))) == json.loads(data)
    # The points that habitat-sim's own test has inside and outside of them.
    assert contains(negative, (-5.1, 0.0, 0.01))
    assert contains(positive, (5.1, 0.0, 0.01))
    assert not contains(negative, (-4.9, 0.0, 0.01))
    assert not contains(positive, (-5.1, 0.0, 0.01))


@pytest.mark.parametrize("up_axis", ["y", "z"])
def test_regions_of_built_meshes_are_where_the_truth_says(tmp_path: Path, up_axis: Any) -> None:
    options = GeometryOptions(up_axis=up_axis)
    list(write_synthetic(tmp_path / "places", scenes=3, seed=5, geometry=options))
    build_dataset(HM3DFolder(tmp_path / "places"), tmp_path / "dataset")
    done = export_dataset(tmp_path / "dataset", tmp_path / "out", to="habitat")
    graphs = list(read_scene_graphs(tmp_path / "dataset"))
    assert (done.scenes, done.rooms) == (3, sum(len(graph.rooms) for graph in graphs))
    for graph in graphs:
        data = (tmp_path / "out" / f"{graph.scene_id}.semantic_config.json").read_bytes()
        exported = {region.name: region for region in decode_regions(data)}
        building = graph.scene_id.partition("-")[2]
        (mesh,) = (tmp_path / "places").rglob(f"{building}.semantic.glb")
        truth = json.loads((mesh.parent / f"{building}.truth.json").read_text())
        for room in graph.rooms:
            region = exported[f"region_{room.region_id}"]
            low, high = true_box(graph, room, truth)  # Z up
            assert region.min_bounds == pytest.approx((low[0], low[2], -high[1]), abs=0.021)
            assert region.max_bounds == pytest.approx((high[0], high[2], -low[1]), abs=0.021)
            middle = (low + high) / 2
            assert contains(region, (middle[0], middle[2], -middle[1]))
        if up_axis == "y":  # the file's own axes
            points = np.concatenate([part.vertices for part in read_parts(mesh)])
            whole = np.array([[r.min_bounds, r.max_bounds] for r in exported.values()])
            assert (points.min(axis=0) <= whole[:, 0].min(axis=0) + 0.021).all()
            assert (points.max(axis=0) >= whole[:, 1].max(axis=0) - 0.021).all()


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


def test_the_row_says_what_it_writes() -> None:
    assert "region_annotations" in EXPORTS["habitat"].summary
