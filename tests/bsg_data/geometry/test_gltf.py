"""Reading GLB: transforms and colours by hand, and every way in which a file can be bad."""

from __future__ import annotations

import contextlib
import struct
import zlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import CORNERS, SQUARE, edited, put_together, take_apart, textured, write_glb
from refusals import refuses

from bsg_data.geometry.gltf import (
    MAX_DEPTH,
    MAX_FACES,
    MAX_NODES,
    MAX_SIDE,
    MAX_TEXELS,
    MeshError,
    read_parts,
)

RED = [[[255, 0, 0]]]


@pytest.fixture
def glb(tmp_path: Path) -> Path:
    return write_glb(tmp_path / "mesh.glb", textured(RED))


def test_nested_transforms_multiply(glb: Path) -> None:
    def nest(tree: dict[str, Any]) -> None:
        mesh = next(i for i, node in enumerate(tree["nodes"]) if "mesh" in node)
        root = len(tree["nodes"])
        tree["nodes"] += [
            {"translation": [10, 0, 0], "children": [root + 1]},
            {"rotation": [0, 0, np.sqrt(0.5), np.sqrt(0.5)], "scale": [2, 2, 2], "mesh": 0},
        ]
        tree["nodes"][mesh].pop("matrix", None)
        tree["scenes"][0]["nodes"] = [root]

    (part,) = read_parts(edited(glb, nest))
    # (x, y) is doubled, turned to (-y, x), and moved by 10.
    expected = [[10, 0, 0], [10, 2, 0], [8, 2, 0], [8, 0, 0]]
    np.testing.assert_allclose(part.vertices.T, expected, atol=1e-6)


def test_a_mesh_that_two_nodes_show_is_there_twice_in_one_order(glb: Path) -> None:
    def show_twice(tree: dict[str, Any]) -> None:
        first = len(tree["nodes"])
        tree["nodes"] += [
            {"translation": [5, 0, 0], "mesh": 0},
            {"translation": [3, 0, 0], "mesh": 0},
        ]
        tree["scenes"][0]["nodes"] = [first, first + 1]

    path = edited(glb, show_twice)
    for _ in range(3):  # trimesh gives nodes random names
        assert [part.vertices[0, 0] for part in read_parts(path)] == [3, 5]


def set_in(*keys: Any, to: Any) -> Callable[[dict[str, Any]], None]:
    def change(tree: dict[str, Any]) -> None:
        entry: Any = tree
        for key in keys[:-1]:
            entry = entry[key]
        entry[keys[-1]] = to

    return change


PRIMITIVE = ("meshes", 0, "primitives", 0)


def show(roots: list[int], nodes: list[dict[str, Any]]) -> Callable[[dict[str, Any]], None]:
    def change(tree: dict[str, Any]) -> None:
        tree["nodes"], tree["scenes"] = nodes, [{"nodes": roots}]

    return change


def sample(sampler: dict[str, int]) -> Callable[[dict[str, Any]], None]:
    """Give the texture a sampler, beside one that nobody uses."""

    def change(tree: dict[str, Any]) -> None:
        tree["samplers"] = [{"wrapS": 33648}, sampler]
        tree["textures"][0]["sampler"] = 1

    return change


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (set_in("accessors", 1, "count", to=10**7), "mesh-unreadable"),
        (set_in("accessors", 1, "count", to=10**9), "mesh-too-large"),
        (set_in("accessors", 0, "count", to=10**9), "mesh-too-large"),
        (set_in("bufferViews", 0, "byteLength", to=10**12), "mesh-unreadable"),
        (set_in("buffers", 0, "uri", to="../../../etc/passwd"), "mesh-elsewhere"),
        (set_in("images", 0, to={"uri": "file:///etc/passwd"}), "mesh-elsewhere"),
        (set_in("nodes", 0, to={}), "mesh-empty"),
        (set_in("meshes", to=[]), "mesh-unreadable"),
        (set_in("scenes", 0, "nodes", to=[]), "mesh-empty"),
        (set_in("extensionsRequired", to=["KHR_draco_mesh_compression"]), "mesh-extension"),
        (set_in("extensionsRequired", to=["KHR_of_tomorrow"]), "mesh-extension"),
        (set_in(*PRIMITIVE, "extensions", to={"KHR_draco_mesh_compression": {}}), "mesh-extension"),
        (
            set_in("bufferViews", 1, "extensions", to={"EXT_meshopt_compression": {}}),
            "mesh-extension",
        ),
        (set_in("nodes", 0, "extensions", to={"EXT_mesh_gpu_instancing": {}}), "mesh-extension"),
        (
            set_in("materials", 0, "extensions", to={"KHR_materials_pbrSpecularGlossiness": {}}),
            "mesh-extension",
        ),
        (set_in("accessors", 1, "sparse", to={"count": 1}), "mesh-data"),
        (lambda tree: tree["accessors"][1].pop("bufferView"), "mesh-data"),
        (set_in("accessors", 1, "componentType", to=5122), "mesh-data"),
        (set_in("accessors", 2, "componentType", to=5123), "mesh-data"),
        (set_in(*PRIMITIVE, "targets", to=[{"POSITION": 1}]), "mesh-shape"),
        (set_in(*PRIMITIVE, "mode", to=7), "mesh-shape"),
        (set_in("nodes", 0, "skin", to=0), "mesh-nodes"),
        (set_in("nodes", 0, "camera", to=0), "mesh-nodes"),
        (show([0, 1], [{"children": [2]}, {"children": [2]}, {"mesh": 0}]), "mesh-nodes"),
        (show([0], [{"children": [1]}, {"mesh": 0, "children": [0]}]), "mesh-nodes"),
        (show([0], [{"children": [n + 1]} for n in range(MAX_DEPTH)] + [{}]), "mesh-nodes"),
        (show(list(range(MAX_NODES + 1)), [{}] * (MAX_NODES + 1)), "mesh-nodes"),
        (set_in("images", 0, "mimeType", to="image/ktx2"), "mesh-texture"),
        (set_in("images", 0, "bufferView", to=0), "mesh-texture"),
        (set_in("textures", 0, to={}), "mesh-texture"),
        (
            set_in("textures", 0, to={"extensions": {"KHR_texture_basisu": {"source": 0}}}),
            "mesh-texture",
        ),
        (set_in("accessors", 2, "count", to=3), "mesh-values"),
        (set_in(*PRIMITIVE, "mode", to=6), "mesh-shape"),
        (sample({"wrapS": 33648}), "mesh-texture"),
        (sample({"wrapS": 33071}), "mesh-texture"),
        (
            set_in("materials", 0, "pbrMetallicRoughness", "baseColorTexture", "texCoord", to=1),
            "mesh-texture",
        ),
    ],
)
def test_a_tree_that_is_not_readable_is_refused(
    glb: Path, change: Callable[[dict[str, Any]], None], code: str
) -> None:
    path = edited(glb, change)
    with refuses(MeshError, code, path, golden=code != "mesh-unreadable"):
        list(read_parts(path))


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda data: b"", "mesh-no-glb"),
        (lambda data: b"PK\3\4" + data[4:], "mesh-no-glb"),
        (lambda data: data[:-9], "mesh-unreadable"),
        (lambda data: data[:20] + b"\xff" + data[21:], "mesh-unreadable"),
    ],
)
def test_bytes_that_are_no_glb_are_refused(
    glb: Path, change: Callable[[bytes], bytes], code: str
) -> None:
    glb.write_bytes(change(glb.read_bytes()))
    with refuses(MeshError, code, glb, golden=code != "mesh-unreadable"):
        list(read_parts(glb))


def test_a_vertex_that_is_not_finite_is_refused(tmp_path: Path) -> None:
    path = write_glb(tmp_path / "nan.glb", textured(RED))
    vertex = np.float32(SQUARE[1]).tobytes()
    assert vertex in path.read_bytes()
    path.write_bytes(path.read_bytes().replace(vertex, np.full(3, np.nan, "f4").tobytes()))
    with refuses(MeshError, "mesh-values", golden=False):
        list(read_parts(path))


@settings(
    max_examples=150, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    places=st.lists(st.integers(0, 1), min_size=1, max_size=4),
    data=st.data(),
)
def test_any_damage_is_read_or_refused_and_nothing_else(
    glb: Path, places: list[int], data: st.DataObject
) -> None:
    whole = glb.with_name("whole")
    if not whole.exists():
        whole.write_bytes(glb.read_bytes())
    damaged = bytearray(whole.read_bytes())
    for _ in places:
        at = data.draw(st.integers(0, len(damaged) - 1))
        damaged[at] = data.draw(st.integers(0, 255))
    glb.write_bytes(bytes(damaged))
    with contextlib.suppress(MeshError):  # and no other error, and no warning
        for part in read_parts(glb):
            assert np.isfinite(part.vertices).all()
            assert part.faces.max(initial=-1) < part.vertices.shape[1]


def test_a_file_that_needs_what_changes_no_colour_is_read(glb: Path) -> None:
    (whole,) = read_parts(glb)
    required = ["KHR_materials_unlit", "KHR_texture_transform", "KHR_materials_variants"]
    (part,) = read_parts(edited(glb, set_in("extensionsRequired", to=required)))
    np.testing.assert_array_equal(part.vertices, whole.vertices)
    np.testing.assert_array_equal(np.asarray(part.places), np.asarray(whole.places))


def test_a_strip_is_read_as_its_triangles(glb: Path) -> None:
    def draw_as_strip(tree: dict[str, Any]) -> None:
        primitive = tree["meshes"][0]["primitives"][0]
        del primitive["indices"]
        primitive["mode"] = 5

    (part,) = read_parts(edited(glb, draw_as_strip))
    assert sorted(sorted(face) for face in part.faces.T.tolist()) == [[0, 1, 2], [1, 2, 3]]


def test_a_mesh_that_is_shown_too_often_is_refused(glb: Path) -> None:
    often = MAX_FACES // MAX_NODES
    faces = textured(RED).faces.repeat(often // 2 + 1, axis=0)
    mesh = trimesh.Trimesh(SQUARE, faces, process=False)
    write_glb(glb, mesh)
    nodes = [{"mesh": 0} for _ in range(MAX_NODES)]
    with refuses(MeshError, "mesh-too-large", glb):
        list(read_parts(edited(glb, show(list(range(MAX_NODES)), nodes))))


def blank_png(width: int, height: int) -> bytes:
    """Return only the head of a PNG: its size is refused before it is unpacked."""
    head = struct.pack(">IIBBBBB", width, height, 8, 2, 0, 0, 0)
    chunks = [(b"IHDR", head), (b"IDAT", zlib.compress(b"")), (b"IEND", b"")]
    return b"\x89PNG\r\n\x1a\n" + b"".join(
        struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))
        for kind, data in chunks
    )


@pytest.mark.parametrize(
    ("side", "images", "code"),
    [
        (MAX_SIDE + 1, 1, "mesh-texture"),
        (30_000, 1, "mesh-texture"),  # Pillow itself refuses it, and trimesh then drops it
        (MAX_SIDE, MAX_TEXELS // MAX_SIDE**2 + 1, "mesh-too-large"),
    ],
)
def test_textures_of_more_texels_than_a_building_has_are_refused(
    glb: Path, side: int, images: int, code: str
) -> None:
    tree, binary = take_apart(glb.read_bytes())
    data = blank_png(side, side)
    start = len(binary)
    tree["bufferViews"].append({"buffer": 0, "byteOffset": start, "byteLength": len(data)})
    view = {"bufferView": len(tree["bufferViews"]) - 1}
    tree["images"] = [view] * images
    tree["textures"] = [{"source": number} for number in range(images)]
    tree["materials"] = [
        {"pbrMetallicRoughness": {"baseColorTexture": {"index": number}}}
        for number in range(images)
    ]
    tree["buffers"][0]["byteLength"] = start + len(data)
    glb.write_bytes(put_together(tree, binary + data))
    with refuses(MeshError, code, glb):
        list(read_parts(glb))


def test_textures_that_end_at_their_edges_end_there(tmp_path: Path) -> None:
    path = write_glb(tmp_path / "m.glb", textured(RED, uv=CORNERS * 2 - 0.5))
    (part,) = read_parts(edited(path, sample({"wrapS": 33071, "wrapT": 33071})))
    places = np.asarray(part.places)
    assert places.min() == 0
    assert 0.99 < places.max() < 1
