"""Meshes as they are written: one wall by hand, measured by the reader of real ones."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from bsg_data.geometry.semantic_mesh import survey_mesh
from painted_meshes.glb import SIZES, encode_mesh
from painted_meshes.surfaces import Surface

X, Z = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])


@pytest.mark.parametrize("coloured_by", ["texture", "vertex", "both"])
def test_a_wall_of_two_halves_is_measured_as_it_was_painted(
    tmp_path: Path, coloured_by: Any
) -> None:
    size = SIZES["small"]
    texels = np.ones((20, 40), dtype=np.int32)  # rows upward, columns across
    texels[:, 20:] = 2
    wall = Surface(0, np.array([1.0, 2.0, 0.0]), X, Z, texels, np.zeros(texels.shape, dtype=bool))
    colours = np.array([[0, 0, 0], [255, 0, 0], [0, 255, 0]], dtype=np.uint8)
    path = tmp_path / "wall.glb"
    rng = np.random.default_rng(0)
    path.write_bytes(
        encode_mesh([wall], colours, size=size, up_axis="z", coloured_by=coloured_by, rng=rng)
    )
    survey = survey_mesh(path, ["FF0000", "00FF00"])
    half = 20 * size.texel
    np.testing.assert_allclose(survey.area.sum(), 2 * half * half, rtol=1e-5)
    np.testing.assert_allclose(survey.box[0, 0], [1, 2, 0], atol=1e-5)
    np.testing.assert_allclose(survey.box[1, 1], [1 + 2 * half, 2, half], atol=1e-5)
    if coloured_by != "vertex":  # whose triangles are as coarse as the wall
        middle = [1 + half / 2, 2, half / 2]
        np.testing.assert_allclose(survey.centroid[0], middle, atol=size.texel / 4)
        np.testing.assert_allclose(survey.area, half * half, rtol=0.02)
