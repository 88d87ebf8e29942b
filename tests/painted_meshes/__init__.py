"""Synthetic buildings with painted meshes like HM3D's, and what is true of them beside each.

`<hash>.truth.json` has boxes, areas and connections, in metres, Z up. The keys are instance ids,
and connections are pairs of region ids:

    {"up_axis": "y", "texel": 0.02,
     "instances": {"17": {"texels": 5400, "area": 2.16, "centroid": [x, y, z],
                          "box": [[x, y, z], [x, y, z]], "main_box": ...}, ...},
     "connections": [[0, 3, "door"], [3, 7, "stairs"], ...]}

The plan that is painted is not that of the building's layout.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.geometry.placement import STAIRS
from bsg_data.scene.class_map import load_class_map
from bsg_data.synthetic.building import SyntheticObject, load_rates, synthesise
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.synthetic.floor_plan import draw_floor_plan
from painted_meshes.glb import SIZES, UpAxis, encode_mesh, measure_truth
from painted_meshes.surfaces import Fixture, furnish

_UNLISTED = 3  # colours that are painted and not listed


@dataclass(frozen=True, slots=True)
class Painting:
    """How meshes are painted."""

    size: str = "small"  # or `full`, as large as a real mesh
    up_axis: UpAxis | None = None  # of the files; None: y in even buildings, z in odd ones


def write_painted(
    out: Path, *, scenes: int, seed: int, painting: Painting = Painting()
) -> list[Path]:
    """Write synthetic buildings with a mesh and the truth beside each annotation; return these."""
    rates, paths = load_rates(), list(write_synthetic(out, scenes=scenes, seed=seed))
    for number, path in enumerate(paths):
        rows = synthesise(rates, seed=seed, number=number).rows
        mesh, truth = paint_building(rows, painting, seed=seed, number=number)
        path.with_suffix(".glb").write_bytes(mesh)
        text = json.dumps(truth, separators=(",", ":")) + "\n"
        path.with_name(path.name.replace(".semantic.txt", ".truth.json")).write_text(text, "utf-8")
    return paths


def paint_building(
    rows: Sequence[SyntheticObject], painting: Painting, *, seed: int, number: int
) -> tuple[bytes, dict[str, Any]]:
    """Return the GLB of a building and its true geometry; equal arguments give equal bytes.

    What the rows list in the null region is put into any room.
    """
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number, 1))))
    size = SIZES[painting.size]
    up_axis: UpAxis = painting.up_axis or ("y" if number % 2 == 0 else "z")
    regions = sorted({row.region_id for row in rows if row.region_id >= 0})
    fixtures = _list_fixtures(rows, regions, rng)
    with_stairs = {fixture.room for fixture in fixtures if fixture.category in STAIRS}
    plan = draw_floor_plan(len(regions), with_stairs=with_stairs, rng=rng)
    surfaces = furnish(plan, fixtures, texel=size.texel, rng=rng)
    mesh = encode_mesh(surfaces, _draw_colours(rows, rng), size=size, up_axis=up_axis)
    truth = measure_truth(surfaces, plan, regions=regions, texel=size.texel)
    return mesh, {"up_axis": up_axis, "texel": size.texel, **truth}


def _list_fixtures(
    rows: Sequence[SyntheticObject], regions: list[int], rng: np.random.Generator
) -> list[Fixture]:
    class_map, place = load_class_map("hm3d45-v1"), {r: room for room, r in enumerate(regions)}
    fixtures = []
    for row in rows:
        entry = class_map.lookup(row.name)
        room = place.get(row.region_id)
        if room is None:
            room = int(rng.integers(len(regions)))
        category = entry.category if entry else None
        fixtures.append(Fixture(row.instance_id, category or "", room))
    return fixtures


def _draw_colours(
    rows: Sequence[SyntheticObject], rng: np.random.Generator
) -> npt.NDArray[np.uint8]:
    """Return the colour of every label `[L, 3]`: background, instances by id, unlisted ones."""
    listed = {row.instance_id: int(str(row.colour), 16) for row in rows}
    taken = {0, *listed.values()}
    free = [int(c) for c in rng.integers(1, 0xFFFFFF, 64) if int(c) not in taken][:_UNLISTED]
    codes = [0, *(listed.get(label, 0) for label in range(1, max(listed) + 1)), *free]
    return np.array([[code >> 16, code >> 8 & 255, code & 255] for code in codes], dtype=np.uint8)
