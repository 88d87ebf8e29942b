"""Measure every instance of a `semantic.glb`: the surface that has its colour.

In HM3D's semantic meshes every texel has the exact colour of an instance. A triangle is the
instance's whose texel is in its middle; one that is longer than a cell is cut into pieces first.
Without a texture, vertex colours are used. All values are in the axes of the file;
`bsg_data.geometry.placement` turns them upright.
"""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from bsg_data.arrays import Floats, Ints
from bsg_data.geometry.colour_labels import BLACK, FIRST, UNLISTED, ColourLabels, LabelSheet
from bsg_data.geometry.gltf import MeshError, MeshPart, naming, read_parts
from bsg_data.geometry.surfaces import (
    BLOCK,
    CELL,
    Labels,
    Surface,
    Triangles,
    find_corners,
    find_labels,
)
from bsg_data.scene.scene_graph import MeshCoverage

_MOST_AREA = 100_000  # square metres
_OWN_SHARE = 0.2  # of its colours' surface that a mesh must have listed to be its scene's


@dataclass(frozen=True, slots=True)
class MeshSurvey:
    """The surface of every listed instance, in the axes of the file; metres."""

    area: Floats  # [I], square metres; 0 without geometry
    centroid: Floats  # [I, 3], weighted by area; NaN without geometry
    box: Floats  # [I, 2, 3], lowest and highest corner; NaN without geometry
    part_box: Floats  # [I, 2, 3], of the largest connected part
    cells: Floats  # [P, 2, 3], the largest parts in pieces: boxes of what lies in a cell of `CELL`
    owner: Ints  # [P], the instance of each piece
    coverage: MeshCoverage


def survey_mesh(
    path: Path, colours: Sequence[str | None], *, snap_colours: int | None = None
) -> MeshSurvey:
    """Measure the instances of a mesh: a GLB, and the colours RRGGBB of its instances `[I]`.

    An instance without a colour, None, gets no surface. With `snap_colours`, a texel of a JPEG
    texture counts as the nearest instance's if no channel differs by more (0..255).

    Raises:
        MeshError: if the file cannot be read, is JPEG unasked, or is another scene's.
    """
    with naming(path):
        data = path.read_bytes()
        palette = ColourLabels(colours, snap_colours)
        tally = _Tally(palette)
        for _, parts in groupby(read_parts(data), key=lambda part: id(part.texture)):
            sheet = None
            for part in parts:
                if part.texture is not None and sheet is None:
                    sheet = palette.read(part.texture)
                tally.add(part, sheet)
        return _summarise(tally, palette, sha256=hashlib.sha256(data).hexdigest())


class _Tally:
    """The surface of all parts, and that without a colour."""

    def __init__(self, palette: ColourLabels) -> None:
        self._palette = palette
        self.surfaces: list[Surface] = []
        self.uncoloured = self.area = 0.0
        self.faces = 0

    def add(self, part: MeshPart, sheet: LabelSheet | None) -> None:
        """Add the triangles of a part, with the labels of its texture."""
        if not np.abs(part.vertices).max(initial=0) < CELL * (2**15 - 1):  # or not finite
            what = "a vertex is not finite, or kilometres away; are its units metres?"
            raise MeshError(what, code="mesh-values")
        named = None if part.colours is None else self._palette.label_vertices(part.colours)
        self.faces += len(part.faces)
        for start in range(0, len(part.faces), BLOCK):
            faces = np.ascontiguousarray(part.faces[start : start + BLOCK].T)
            triangles = Triangles.of_corners(part.vertices.take(faces, axis=1))
            if part.places is not None and sheet is not None:
                for pieces, places in triangles.cut_long(part.places.take(faces)):
                    self._add(pieces, sheet.label(places))
            elif named is not None:
                first, second, third = named.take(faces)
                common = np.where(second == third, second, first)  # of three that differ, the first
                for pieces, label in triangles.cut_long(
                    np.stack([common] * 3).astype(np.complex64)
                ):
                    self._add(pieces, np.round(label.real).astype(np.uint16))
            else:
                self.uncoloured += float(triangles.measure()[0].sum(dtype=float))

    def _add(self, triangles: Triangles, labels: Labels) -> None:
        surface = Surface.of_triangles(triangles, labels)
        self.surfaces.append(surface)
        self.area += float(surface.sums[0].sum())
        if self.area > _MOST_AREA:
            what = f"over {_MOST_AREA:,} m² of surface, more than a building has; is it in metres?"
            raise MeshError(what, code="mesh-values")


def _summarise(tally: _Tally, palette: ColourLabels, *, sha256: str) -> MeshSurvey:
    texels = palette.texels
    _refuse_uncoloured(tally.area, tally.uncoloured)
    surface = Surface.join(tally.surfaces)
    box, (areas, *moments) = surface.measure(len(texels))
    coverage = MeshCoverage(
        sha256=sha256,
        texels=int(texels.sum()),
        listed=int(texels[FIRST:].sum()) - palette.snapped,
        snapped=palette.snapped,
        black=int(texels[BLACK]),
        unlisted=int(texels[UNLISTED]),
        unlisted_colours=palette.count_unlisted(),
        faces=tally.faces,
        area=round(float(areas.sum()) + tally.uncoloured, 3),
        listed_area=round(float(areas[FIRST:].sum()), 3),
        unlisted_area=round(float(areas[:FIRST].sum()), 3),
        uncoloured_area=round(tally.uncoloured, 3),
        without_geometry=int((areas[FIRST:] == 0).sum()),
    )
    _refuse_strangers(coverage)
    parts = surface.largest_parts(first=FIRST)
    part_box, owner = parts.measure(len(texels))[0][FIRST:], find_labels(parts.cells) - FIRST
    corners = find_corners(parts.cells)
    cells = np.stack([corners, corners + CELL], axis=1)
    area, is_shown = areas[FIRST:], areas[FIRST:] > 0
    return MeshSurvey(
        area=area,
        centroid=np.stack(moments, axis=1)[FIRST:] / np.where(is_shown, area, np.nan)[:, None],
        box=np.where(is_shown[:, None, None], box[FIRST:], np.nan),
        part_box=part_box,
        cells=np.clip(cells, part_box[owner, :1], part_box[owner, 1:]),
        owner=owner,
        coverage=coverage,
    )


def _refuse_uncoloured(coloured: float, uncoloured: float) -> None:
    whole = coloured + uncoloured
    if not whole > 0:
        raise MeshError("its triangles have no area", code="mesh-empty")
    if uncoloured > 0.5 * whole:
        raise MeshError(
            f"{uncoloured / whole:.0%} of its surface has neither a readable texture with "
            "coordinates nor vertex colours: not a semantic mesh",
            code="mesh-stranger",
        )


def _refuse_strangers(coverage: MeshCoverage) -> None:
    """Refuse a mesh that does not show the instances that its annotation lists."""
    if not coverage.listed_area >= _OWN_SHARE * coverage.area:
        raise MeshError(
            f"only {coverage.listed_area / coverage.area:.0%} of its surface has a colour that the "
            "annotation lists: it is another scene's, or not a semantic mesh",
            code="mesh-stranger",
        )
