"""Reading GLB: transforms by hand, and the ways in which a file can be bad."""

from __future__ import annotations

import contextlib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import CORNERS, SQUARE, edited, textured, write_glb
from refusals import refuses

from bsg_data.geometry.gltf import MeshError, read_parts
from bsg_data.geometry.semantic_mesh import survey_mesh

RED = [[[255, 0, 0]]]
Change = Callable[[dict[str, Any]], Any]


@pytest.fixture
def glb(tmp_path: Path) -> Path:
    return write_glb(tmp_path / "mesh.glb", textured(RED))


def set_in(*keys: Any, to: Any) -> Change:
    def change(tree: dict[str, Any]) -> None:
        entry: Any = tree
        for key in keys[:-1]:
            entry = entry[key]
        entry[keys[-1]] = to

    return change


def show(*nodes: dict[str, Any]) -> Change:
    """Make these the nodes of the scene; the first is its root."""

    def change(tree: dict[str, Any]) -> None:
        tree["nodes"], tree["scenes"] = list(nodes), [{"nodes": [0]}]

    return change


def sample(sampler: dict[str, int]) -> Change:
    """Give the texture a sampler, beside one that nobody uses."""

    def change(tree: dict[str, Any]) -> None:
        tree["samplers"] = [{"wrapS": 33648}, sampler]
        tree["textures"][0]["sampler"] = 1

    return change


def test_nested_transforms_multiply(glb: Path) -> None:
    turned = {"rotation": [0, 0, np.sqrt(0.5), np.sqrt(0.5)], "scale": [2, 2, 2], "mesh": 0}
    nested = show({"translation": [10, 0, 0], "children": [1]}, turned)
    (part,) = read_parts(edited(glb, nested).read_bytes())
    # (x, y) is doubled, turned to (-y, x), and moved by 10.
    expected = [[10, 0, 0], [10, 2, 0], [8, 2, 0], [8, 0, 0]]
    np.testing.assert_allclose(part.vertices.T, expected, atol=1e-6)


def test_what_is_shown_twice_is_there_twice_in_one_order(glb: Path) -> None:
    """Two primitives of a mesh, under two nodes each."""
    moved = [{"translation": [x, 0, 0], "mesh": 0} for x in (5, 3)]

    def show_twice(tree: dict[str, Any]) -> None:
        show({"children": [1, 2]}, *moved)(tree)
        tree["meshes"][0]["primitives"] *= 2

    data = edited(glb, show_twice).read_bytes()
    for _ in range(3):  # trimesh gives nodes random names
        assert [part.vertices[0, 0] for part in read_parts(data)] == [3, 5, 3, 5]


PRIMITIVE = ("meshes", 0, "primitives", 0)
TEXTURE = ("materials", 0, "pbrMetallicRoughness", "baseColorTexture")


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (set_in("accessors", 1, "count", to=10**7), "mesh-unreadable"),
        (set_in("accessors", 2, "count", to=3), "mesh-unreadable"),
        (set_in("meshes", to=[]), "mesh-empty"),
        (set_in("nodes", 0, to={}), "mesh-empty"),
        (set_in("buffers", 0, "uri", to="../../../etc/passwd"), "mesh-elsewhere"),
        (set_in("images", 0, to={"uri": "file:///etc/passwd"}), "mesh-elsewhere"),
        (set_in("extensionsUsed", to=["KHR_draco_mesh_compression"]), "mesh-extension"),
        (set_in("extensionsRequired", to=["KHR_of_tomorrow"]), "mesh-extension"),
        (set_in("accessors", 1, "sparse", to={"count": 1}), "mesh-data"),
        (set_in("accessors", 2, "componentType", to=5123), "mesh-data"),
        (set_in(*PRIMITIVE, "targets", to=[{"POSITION": 1}]), "mesh-shape"),
        (set_in(*PRIMITIVE, "mode", to=6), "mesh-shape"),
        (sample({"wrapS": 33648}), "mesh-texture"),
        (sample({"wrapS": 33071}), "mesh-texture"),
        (set_in(*TEXTURE, "texCoord", to=1), "mesh-texture"),
        (set_in("images", 0, "bufferView", to=0), "mesh-stranger"),
    ],
)
def test_a_tree_that_is_not_readable_is_refused(glb: Path, change: Change, code: str) -> None:
    path = edited(glb, change)
    with refuses(MeshError, code, path):
        survey_mesh(path, ["FF0000"])


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda data: b"", "mesh-no-glb"),
        (lambda data: b"PK\3\4" + data[4:], "mesh-no-glb"),
        (lambda data: data[:-9], "mesh-unreadable"),
        (lambda data: data[:20] + b"\xff" + data[21:], "mesh-unreadable"),
        (
            lambda data: data.replace(np.float32(SQUARE[1]).tobytes(), b"\xff" * 12),  # NaN
            "mesh-values",
        ),
    ],
)
def test_bytes_that_are_no_mesh_are_refused(
    glb: Path, change: Callable[[bytes], bytes], code: str
) -> None:
    glb.write_bytes(change(glb.read_bytes()))
    with refuses(MeshError, code, glb):
        survey_mesh(glb, ["FF0000"])


@settings(
    max_examples=100, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(bits=st.lists(st.tuples(st.integers(0, 10**6), st.integers(0, 255)), min_size=1, max_size=4))
def test_any_damage_is_read_or_refused_and_nothing_else(
    glb: Path, bits: list[tuple[int, int]]
) -> None:
    whole = glb.with_name("whole")
    if not whole.exists():
        whole.write_bytes(glb.read_bytes())
    damaged = bytearray(whole.read_bytes())
    for at, value in bits:
        damaged[at % len(damaged)] = value
    glb.write_bytes(bytes(damaged))
    with contextlib.suppress(MeshError):  # and no other error, and no warning
        assert np.isfinite(survey_mesh(glb, ["FF0000"]).area).all()


def test_a_file_that_needs_what_changes_no_colour_is_read(glb: Path) -> None:
    required = ["KHR_materials_unlit", "EXT_texture_webp", "KHR_materials_variants"]
    edited(glb, set_in("extensionsRequired", to=required))
    assert survey_mesh(glb, ["FF0000"]).area == pytest.approx(1)


def test_a_strip_is_read_as_its_triangles(glb: Path) -> None:
    def draw_as_strip(tree: dict[str, Any]) -> None:
        primitive = tree["meshes"][0]["primitives"][0]
        del primitive["indices"]
        primitive["mode"] = 5

    (part,) = read_parts(edited(glb, draw_as_strip).read_bytes())
    assert sorted(sorted(face) for face in part.faces.tolist()) == [[0, 1, 2], [1, 2, 3]]


def test_textures_that_end_at_their_edges_end_there(tmp_path: Path) -> None:
    path = write_glb(tmp_path / "m.glb", textured(RED, uv=CORNERS * 2 - 0.5))
    (part,) = read_parts(edited(path, sample({"wrapS": 33071, "wrapT": 33071})).read_bytes())
    places = np.asarray(part.places)
    assert places.real.min() == places.imag.min() == 0
    assert 0.99 < places.real.max() < 1
