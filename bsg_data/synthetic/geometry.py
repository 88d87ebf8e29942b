"""Make the floor plan, the mesh and the ground truth of a synthetic building."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from bsg_data.geometry.placement import STAIRS
from bsg_data.scene.class_map import ClassMap, load_class_map
from bsg_data.scene.scene_graph import SceneObject
from bsg_data.synthetic.floor_plan import draw_floor_plan
from bsg_data.synthetic.furnishing import Fixture, furnish
from bsg_data.synthetic.meshes import SIZES, Colours, UpAxis, encode_mesh, measure_truth

_UNLISTED = 3  # colours that are painted and not listed
_RATES_MAP = "hm3d45-v1"  # by whose categories the rates were fitted; another gives other bytes


@dataclass(frozen=True, slots=True)
class GeometryOptions:
    """How the meshes of synthetic buildings are written.

    Attributes:
        size: `small`, or `full`, as large as a real mesh.
        coloured_by: `texture`, `vertex` or `both`.
        up_axis: the axis that points up in the files; None: y in even buildings, z in odd ones.
    """

    size: str = "small"
    coloured_by: Colours = "texture"
    up_axis: UpAxis | None = None


def shape_building(
    rows: tuple[SceneObject, ...], options: GeometryOptions, *, seed: int, number: int
) -> tuple[bytes, dict[str, Any]]:
    """Return the GLB of a building and its true geometry; equal arguments give equal bytes.

    Args:
        rows: its annotation; what is listed in the null region is put into any room.
        options: how the mesh is written.
        seed: of the set of buildings.
        number: the building's place in the set.
    """
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number, 1))))
    size = SIZES[options.size]
    up_axis: UpAxis = options.up_axis or ("y" if number % 2 == 0 else "z")
    regions = sorted({row.room_index for row in rows if row.room_index >= 0})
    fixtures = _list_fixtures(rows, regions, load_class_map(_RATES_MAP), rng)
    with_stairs = {fixture.room for fixture in fixtures if fixture.category in STAIRS}
    plan = draw_floor_plan(len(regions), with_stairs=with_stairs, rng=rng)
    surfaces = furnish(plan, fixtures, texel=size.texel, rng=rng)
    mesh = encode_mesh(
        surfaces,
        _draw_colours(rows, rng),
        size=size,
        up_axis=up_axis,
        coloured_by=options.coloured_by,
        rng=rng,
    )
    truth = measure_truth(surfaces, plan, regions=regions, texel=size.texel)
    return mesh, {"up_axis": up_axis, "texel": size.texel, **truth}


def _list_fixtures(
    rows: tuple[SceneObject, ...],
    regions: list[int],
    class_map: ClassMap,
    rng: np.random.Generator,
) -> list[Fixture]:
    place = {region: room for room, region in enumerate(regions)}
    fixtures = []
    for row in rows:
        entry = class_map.lookup(row.raw_category)
        room = place.get(row.room_index)
        if room is None:
            room = int(rng.integers(len(regions)))
        fixtures.append(Fixture(row.instance_id, entry.category if entry else "", room))
    return fixtures


def _draw_colours(rows: tuple[SceneObject, ...], rng: np.random.Generator) -> npt.NDArray[np.uint8]:
    """Return the colour of every label `[L, 3]`: background, instances by id, unlisted ones."""
    listed = {row.instance_id: int(str(row.colour), 16) for row in rows}
    taken = {0, *listed.values()}
    free = [int(c) for c in rng.integers(1, 0xFFFFFF, 64) if int(c) not in taken][:_UNLISTED]
    codes = [0, *(listed.get(label, 0) for label in range(1, max(listed) + 1)), *free]
    return np.array([[code >> 16, code >> 8 & 255, code & 255] for code in codes], dtype=np.uint8)
