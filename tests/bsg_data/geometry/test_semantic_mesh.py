"""Surfaces by colour: squares worked out by hand, and beside a loop over texels."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from mesh_files import CORNERS, FACES, SQUARE, as_file, textured, write_glb
from PIL import Image

from bsg_data.geometry.gltf import MeshError
from bsg_data.geometry.semantic_mesh import survey_mesh

COLOURS = ("FF0000", "00FF00", "0000FF")
RGB = {"r": (255, 0, 0), "g": (0, 255, 0), "b": (0, 0, 255), ".": (0, 0, 0), "?": (1, 2, 3)}


def paint(*rows: str) -> np.ndarray:
    """Return pixels from letters, row 0 first."""
    return np.array([[RGB[letter] for letter in row] for row in rows], dtype=np.uint8)


def test_a_square_of_one_colour(tmp_path: Path) -> None:
    path = write_glb(tmp_path / "m.glb", textured(paint("g"), size=(2, 3)))
    survey = survey_mesh(path, COLOURS)
    np.testing.assert_allclose(survey.area, [0, 6, 0])
    np.testing.assert_allclose(survey.centroid[1], [1, 1.5, 0])
    np.testing.assert_allclose(survey.box[1], [[0, 0, 0], [2, 3, 0]])
    np.testing.assert_allclose(survey.part_box[1], [[0, 0, 0], [2, 3, 0]])
    assert np.isnan(survey.box[[0, 2]]).all()
    coverage = survey.coverage
    assert (coverage.texels, coverage.listed, coverage.faces) == (1, 1, 2)
    assert (coverage.area, coverage.listed_area, coverage.without_geometry) == (6, 6, 2)
    assert len(coverage.sha256) == 64


def test_triangles_that_straddle_are_divided_texel_by_texel(tmp_path: Path) -> None:
    # Ten columns over one metre: three red, seven green; the diagonal runs through both.
    path = write_glb(tmp_path / "m.glb", textured(paint(*["rrrggggggg"] * 10)))
    survey = survey_mesh(path, COLOURS)
    np.testing.assert_allclose(survey.area, [0.3, 0.7, 0], atol=0.01)
    np.testing.assert_allclose(survey.box[0], [[0, 0, 0], [0.3, 1, 0]], atol=0.03)
    np.testing.assert_allclose(survey.box[1], [[0.3, 0, 0], [1, 1, 0]], atol=0.03)
    np.testing.assert_allclose(survey.centroid[0], [0.15, 0.5, 0], atol=0.01)


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture]
)
@given(
    letters=st.lists(st.sampled_from("rgb.?"), min_size=16, max_size=16),
    palette=st.booleans(),
    shift=st.integers(-3, 3),
)
def test_any_picture_agrees_with_a_loop_over_its_texels(
    tmp_path: Path, letters: list[str], palette: bool, shift: int
) -> None:
    rows = ["".join(letters[k : k + 4]) for k in range(0, 16, 4)]
    rows[0] = "rggb"  # enough that it is this scene's
    image = Image.fromarray(paint(*rows))
    image = image.quantize(8, method=Image.Quantize.FASTOCTREE) if palette else image
    shown = np.asarray(image.convert("RGB"))
    # Textures repeat: whole turns of the coordinates change nothing.
    mesh = textured(None, size=(4, 4), uv=CORNERS + shift, image=image)
    path = write_glb(tmp_path / "m.glb", mesh)
    survey = survey_mesh(path, COLOURS)
    for number, colour in enumerate(COLOURS):
        here = np.argwhere((shown == [int(colour[i : i + 2], 16) for i in (0, 2, 4)]).all(axis=2))
        assert survey.area[number] == pytest.approx(len(here), abs=0.35)
        if len(here):
            low, high = here.min(axis=0)[::-1], here.max(axis=0)[::-1] + 1
            np.testing.assert_allclose(survey.box[number, 0, :2], low, atol=0.35)
            np.testing.assert_allclose(survey.box[number, 1, :2], high, atol=0.35)
    coverage = survey.coverage
    parts = (coverage.listed, coverage.snapped, coverage.black, coverage.unlisted)
    assert sum(parts) == coverage.texels == 16
    black = (shown == 0).all(axis=2).sum()
    assert coverage.black == black
    areas = (coverage.listed_area, coverage.unlisted_area, coverage.uncoloured_area)
    assert sum(areas) == pytest.approx(coverage.area, abs=0.01)


def test_many_small_faces_are_as_one_square(tmp_path: Path) -> None:
    """They are measured block by block; a vertex between two colours is of both."""
    sides = 100
    row, column = (grid.ravel() for grid in np.mgrid[0 : sides + 1, 0 : sides + 1])
    places = np.stack([column, row], axis=1) / sides
    first = (np.arange(sides)[:, None] * (sides + 1) + np.arange(sides)).ravel()
    one, other = (
        (first, first + 1, first + sides + 2),
        (first, first + sides + 2, first + sides + 1),
    )
    faces = np.concatenate([np.stack(one, axis=1), np.stack(other, axis=1)])
    points = np.pad(places * [4, 2], [(0, 0), (0, 1)])
    uv = places * [1, -1] + [0, 1]
    texture = trimesh.visual.TextureVisuals(
        uv=uv,
        material=trimesh.visual.material.PBRMaterial(
            baseColorTexture=Image.fromarray(paint(*["r" * 25 + "g" * 75] * 100))
        ),
    )
    mesh = trimesh.Trimesh(points, faces, visual=texture, process=False)
    survey = survey_mesh(write_glb(tmp_path / "m.glb", mesh), COLOURS)
    assert survey.coverage.faces == 20_000
    np.testing.assert_allclose(survey.area, [2, 6, 0], rtol=1e-6)
    np.testing.assert_allclose(survey.centroid[:2], [[0.5, 1, 0], [2.5, 1, 0]], atol=1e-6)
    np.testing.assert_allclose(survey.part_box[0], [[0, 0, 0], [1, 2, 0]], atol=1e-6)
    np.testing.assert_allclose(survey.part_box[1, 1], [4, 2, 0], atol=1e-6)


def test_the_largest_part_leaves_out_what_is_painted_astray(tmp_path: Path) -> None:
    far = textured(paint("r"), size=(0.3, 0.3))
    far.apply_translation([8, 0, 0])
    path = write_glb(tmp_path / "m.glb", textured(paint("r"), size=(2, 2)), far)
    survey = survey_mesh(path, COLOURS)
    np.testing.assert_allclose(survey.box[0], [[0, 0, 0], [8.3, 2, 0]], atol=1e-6)
    np.testing.assert_allclose(survey.part_box[0], [[0, 0, 0], [2, 2, 0]], atol=1e-6)
    assert survey.area[0] == pytest.approx(4.09)  # all of it is counted
    assert (survey.cells[:, 1, 0] < 3).all()


def test_vertex_colours_stand_in_for_a_texture(tmp_path: Path) -> None:
    colours = np.array([[255, 0, 0], [255, 0, 0], [0, 255, 0], [0, 255, 0]], dtype=np.uint8)
    mesh = trimesh.Trimesh(SQUARE, FACES, vertex_colors=colours, process=False)
    survey = survey_mesh(write_glb(tmp_path / "m.glb", mesh), COLOURS)
    # Of each triangle, the third nearest to a corner is that corner's.
    np.testing.assert_allclose(survey.area, [0.5 * 2 / 3 + 0.5 / 3, 0.5 / 3 + 0.5 * 2 / 3, 0])
    # The red thirds of the second triangle reach its centre, (1/3, 2/3).
    np.testing.assert_allclose(survey.box[0], [[0, 0, 0], [1, 2 / 3, 0]], atol=1e-6)
    np.testing.assert_allclose(survey.centroid[0] + survey.centroid[1], [1, 1, 0], atol=1e-6)
    assert survey.coverage.texels == 0


def test_jpeg_is_refused_unless_colours_are_snapped(tmp_path: Path) -> None:
    pixels = np.repeat(np.repeat(paint("rg", "bb"), 16, axis=0), 16, axis=1)
    jpeg = as_file(Image.fromarray(pixels), "JPEG", quality=95)
    path = write_glb(tmp_path / "m.glb", textured(None, image=jpeg))
    with pytest.raises(MeshError):
        survey_mesh(path, COLOURS)
    survey = survey_mesh(path, COLOURS, snap_colours=60)
    coverage = survey.coverage
    assert coverage.texels == 32 * 32
    assert coverage.snapped > 0
    assert coverage.listed + coverage.snapped + coverage.black + coverage.unlisted == 1024
    np.testing.assert_allclose(survey.area, [0.25, 0.25, 0.5], atol=0.05)


def bare() -> trimesh.Trimesh:
    mesh = trimesh.Trimesh(SQUARE, FACES, process=False)
    mesh.visual = trimesh.visual.texture.TextureVisuals()
    return mesh


@pytest.mark.parametrize(
    "mesh",
    [
        textured(paint("?????r")),  # of another scene
        textured(paint("?"), size=(0.01, 0.01)),
        textured(paint("r"), size=(9000, 1)),  # kilometres
        textured(paint("r"), size=(1, 0)),
        bare(),
    ],
)
def test_a_mesh_that_is_not_of_the_scene_is_refused(tmp_path: Path, mesh: trimesh.Trimesh) -> None:
    with pytest.raises(MeshError):
        survey_mesh(write_glb(tmp_path / "m.glb", mesh), COLOURS)
