"""Surfaces by colour: squares worked out by hand, and beside a loop over texels."""

from __future__ import annotations

from pathlib import Path

import networkx as nx
import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import CORNERS, FACES, SQUARE, as_file, textured, write_glb
from PIL import Image
from refusals import refuses

from bsg_data.geometry.gltf import MeshError
from bsg_data.geometry.semantic_mesh import survey_mesh
from bsg_data.geometry.surfaces import CELL, Surface, Triangles, find_labels

COLOURS = ("FF0000", "00FF00", "0000FF")
RGB = {"r": (255, 0, 0), "g": (0, 255, 0), "b": (0, 0, 255), ".": (0, 0, 0), "?": (1, 2, 3)}


def paint(*rows: str) -> np.ndarray:
    """Return pixels from letters, row 0 first."""
    return np.array([[RGB[letter] for letter in row] for row in rows], dtype=np.uint8)


def test_a_square_of_one_colour(tmp_path: Path) -> None:
    path = write_glb(tmp_path / "m.glb", textured(paint("g"), size=(2, 3)))
    survey = survey_mesh(path, COLOURS)
    np.testing.assert_allclose(survey.area, [0, 6, 0], rtol=1e-6)
    np.testing.assert_allclose(survey.centroid[1], [1, 1.5, 0], rtol=1e-6)
    for box in (survey.box, survey.part_box):
        np.testing.assert_allclose(box[1], [[0, 0, 0], [2, 3, 0]], rtol=1e-6)
    assert np.isnan(survey.box[[0, 2]]).all()
    coverage = survey.coverage
    assert (coverage.texels, coverage.listed, coverage.faces) == (1, 1, 2)
    assert (coverage.area, coverage.listed_area, coverage.without_geometry) == (6, 6, 2)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    letters=st.lists(st.sampled_from("rgb.?"), min_size=16, max_size=16),
    mode=st.sampled_from(["RGB", "RGBA", "P"]),
    shift=st.integers(-3, 3),
)
def test_any_picture_agrees_with_a_loop_over_its_texels(
    tmp_path: Path, letters: list[str], mode: str, shift: int
) -> None:
    """A texel is 1 m wide, and the pieces of a triangle are 5 cm."""
    rows = ["".join(letters[k : k + 4]) for k in range(0, 16, 4)]
    rows[0] = "rggb"  # enough that it is this scene's
    image = Image.fromarray(paint(*rows))
    image = image.quantize(8) if mode == "P" else image.convert(mode)
    shown = np.asarray(image.convert("RGB"))
    # Textures repeat: whole turns of the coordinates change nothing.
    mesh = textured(None, size=(4, 4), uv=CORNERS + shift, image=image)
    survey = survey_mesh(write_glb(tmp_path / "m.glb", mesh), COLOURS)
    for number, colour in enumerate(COLOURS):
        here = np.argwhere((shown == list(bytes.fromhex(colour))).all(axis=2))
        assert survey.area[number] == pytest.approx(len(here), rel=0.08)
        if len(here):
            ends = [here.min(axis=0)[::-1], here.max(axis=0)[::-1] + 1]
            np.testing.assert_allclose(survey.box[number, :, :2], ends, atol=0.05)
    coverage = survey.coverage
    parts = (coverage.listed, coverage.snapped, coverage.black, coverage.unlisted)
    assert sum(parts) == coverage.texels == 16
    assert coverage.black == (shown == 0).all(axis=2).sum()
    assert coverage.unlisted_colours == (RGB["?"] in map(tuple, shown.reshape(-1, 3)))
    areas = (coverage.listed_area, coverage.unlisted_area, coverage.uncoloured_area)
    assert sum(areas) == pytest.approx(coverage.area, abs=0.01)


def test_the_largest_part_leaves_out_what_is_painted_astray(tmp_path: Path) -> None:
    far = textured(paint("r"), size=(0.3, 0.3))
    far.apply_translation([8, 0, 0])
    path = write_glb(tmp_path / "m.glb", textured(paint("r"), size=(2, 2)), far)
    survey = survey_mesh(path, COLOURS)
    np.testing.assert_allclose(survey.box[0], [[0, 0, 0], [8.3, 2, 0]], atol=1e-6)
    np.testing.assert_allclose(survey.part_box[0], [[0, 0, 0], [2, 2, 0]], atol=1e-6)
    assert survey.area[0] == pytest.approx(4.09)  # all of it is counted
    assert (survey.cells[:, 1, 0] < 3).all()


# A label and the middle of a cell, in cells.
spots = st.lists(
    st.tuples(st.integers(2, 3), *(st.integers(-2, 2) for _ in "xyz")), min_size=1, max_size=40
)


@given(spots)
def test_the_largest_part_is_that_of_a_graph_of_touching_cells(
    some: list[tuple[int, ...]],
) -> None:
    names = sorted(set(some))
    graph = nx.Graph()
    graph.add_nodes_from(names)
    graph.add_edges_from(
        (one, other)
        for one in names
        for other in names
        if one[0] == other[0] and np.abs(np.subtract(one, other)).max() == 1
    )
    parts = [sorted(part) for part in nx.connected_components(graph)]
    kept = make_surface(some).largest_parts(first=2)
    boxes, sums = kept.measure(4)
    for label in sorted({name[0] for name in names}):
        own = [part for part in parts if part[0][0] == label]
        best = np.array(min(own, key=lambda part: (-len(part), part[0])))  # of equals the first
        assert (find_labels(kept.cells) == label).sum() == len(best)
        middles = (best[:, 1:] + 0.5) * CELL
        np.testing.assert_allclose(boxes[label], [middles.min(0), middles.max(0)], atol=0.01)
        areas = 5e-5 * sum(some.count(tuple(name)) for name in best.tolist())
        assert sums[0, label] == pytest.approx(areas, rel=1e-4)


def make_surface(some: list[tuple[int, ...]]) -> Surface:
    """Return triangles of half a square centimetre around the middles of cells."""
    middles = (np.array(some)[:, 1:].T + 0.5) * CELL
    offsets = np.array([[-0.005, 0.005, 0], [-0.005, -0.005, 0.005], [0, 0, 0]])
    corners = (middles[:, None] + offsets[:, :, None]).astype(np.float32)
    labels = np.array([label for label, *_ in some], dtype=np.uint16)
    return Surface.join([Surface.of_triangles(Triangles.of_corners(corners), labels)])


def test_vertex_colours_stand_in_for_a_texture(tmp_path: Path) -> None:
    colours = np.array([[255, 0, 0], [255, 0, 0], [0, 255, 0], [0, 255, 0]], dtype=np.uint8)
    mesh = trimesh.Trimesh(SQUARE, FACES, vertex_colors=colours, process=False)
    survey = survey_mesh(write_glb(tmp_path / "m.glb", mesh), COLOURS)
    np.testing.assert_allclose(survey.area, [0.5, 0.5, 0], rtol=1e-6)  # most corners count
    assert survey.coverage.texels == 0


def test_jpeg_is_refused_unless_colours_are_snapped(tmp_path: Path) -> None:
    pixels = np.repeat(np.repeat(paint("rg", "bb"), 16, axis=0), 16, axis=1)
    jpeg = as_file(Image.fromarray(pixels), "JPEG", quality=95)
    path = write_glb(tmp_path / "m.glb", textured(None, image=jpeg))
    with pytest.raises(MeshError, match="snap_colours"):
        survey_mesh(path, COLOURS)
    survey = survey_mesh(path, COLOURS, snap_colours=60)
    coverage = survey.coverage
    assert coverage.snapped > 0
    parts = (coverage.listed, coverage.snapped, coverage.black, coverage.unlisted)
    assert sum(parts) == coverage.texels == 32 * 32
    np.testing.assert_allclose(survey.area, [0.25, 0.25, 0.5], atol=0.05)


def bare() -> trimesh.Trimesh:
    mesh = trimesh.Trimesh(SQUARE, FACES, process=False)
    mesh.visual = trimesh.visual.texture.TextureVisuals()
    return mesh


@pytest.mark.parametrize(
    ("mesh", "code"),
    [
        (textured(paint("?????r")), "mesh-stranger"),
        (bare(), "mesh-stranger"),
        (textured(paint("r"), size=(9000, 1)), "mesh-values"),  # kilometres
        (textured(paint("r"), size=(900, 900)), "mesh-values"),  # more than a building has
        (textured(paint("r"), size=(1, 0)), "mesh-empty"),
    ],
)
def test_a_mesh_that_is_not_of_the_scene_is_refused(
    tmp_path: Path, mesh: trimesh.Trimesh, code: str
) -> None:
    path = write_glb(tmp_path / "mesh.glb", mesh)
    with refuses(MeshError, code, path):
        survey_mesh(path, COLOURS)
