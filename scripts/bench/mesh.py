"""Measure what a full-size mesh costs beside trimesh reading it and its pixels."""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import trimesh
from painted_meshes import Painting, write_painted
from timing import Speed, time_both

from bsg_data.geometry.semantic_mesh import survey_mesh
from bsg_data.sources.hm3d import parse_annotation

SCENE = 1  # of seed 0: 22 rooms, about 1,000 objects, 2.8 million triangles


def measure(hm3d: Path | None) -> Iterator[Speed]:
    """Yield what a survey takes beside reading the mesh and its pixels."""
    with tempfile.TemporaryDirectory() as folder:
        full = Painting(size="full")
        *_, text = write_painted(Path(folder, "full"), scenes=SCENE + 1, seed=0, painting=full)
        objects, _ = parse_annotation(text.read_bytes(), path=text)
        mesh, colours = text.with_suffix(".glb"), [str(one.colour) for one in objects]
        triangles = sum(len(part.faces) for part in trimesh.load_scene(mesh).geometry.values())
        assert survey_mesh(mesh, colours).coverage.faces == triangles
        ours, theirs = time_both(lambda: survey_mesh(mesh, colours), lambda: load(mesh))
    yield Speed(
        what="`survey_mesh` of a full-size scene",
        against="trimesh.load, textures unpacked",
        ours_s=ours,
        theirs_s=theirs,
        target=2,
    )


def load(mesh: Path) -> None:
    """Read a mesh and its pixels."""
    for part in trimesh.load_scene(mesh).geometry.values():
        np.asarray(part.visual.material.baseColorTexture)
