"""Measure every instance of a `semantic.glb`: the surface that has its colour.

In HM3D's semantic meshes every texel has the exact colour of an instance, so no colours are
averaged. A face of one colour belongs to one instance. A face of several colours is divided among
them texel by texel. Without a texture, vertex colours are used. All values are in the axes of the
file; `bsg_data.geometry.placement` turns them upright.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path

import numpy as np

from bsg_data.arrays import Floats, Ints, find_runs
from bsg_data.geometry.colour_labels import BLACK, FIRST, UNLISTED, ColourLabels, LabelSheet
from bsg_data.geometry.gltf import MeshError, MeshPart, naming, read_parts
from bsg_data.geometry.surfaces import (
    CELL,
    Labels,
    SurfaceCells,
    divide_triangle,
    find_longest,
    find_spans,
    join_cells,
    keep_largest_parts,
    measure_areas,
    split_corners,
    take_corners,
)
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.scene.scene_graph import MeshCoverage

_FINE = 4.0  # samples a texel where a face straddles instances
_MOST_SAMPLES = 1_000_000_000  # of one mesh: some minutes
_BATCH = 2**19  # samples or faces in memory
_MOST_CELLS = 8_000_000  # of one mesh: 80,000 square metres
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
    path: Path, colours: Sequence[str], *, snap_colours: int | None = None
) -> MeshSurvey:
    """Measure the instances of a mesh: a GLB, and the colours RRGGBB of its instances `[I]`.

    With `snap_colours`, a texel of a JPEG texture counts as the nearest instance's if no channel
    differs by more (0..255).

    Raises:
        MeshError: if the file cannot be read, is JPEG unasked, or is another scene's.
    """
    with naming(path):
        palette = ColourLabels(colours, snap_colours)
        tally = _Tally(len(colours) + FIRST)
        for _, parts in groupby(read_parts(path), key=lambda part: id(part.texture)):
            sheet = None
            for part in parts:
                if part.texture is not None and sheet is None:
                    sheet = LabelSheet(palette.label(part.texture))
                tally.add(part, sheet, palette)
        tally.refuse_strangers()
    return tally.summarise(_cover(tally, palette, sha256=hash_file(path)))


def _cover(tally: _Tally, palette: ColourLabels, *, sha256: str) -> MeshCoverage:
    texels = palette.texels
    return MeshCoverage(
        sha256=sha256,
        texels=int(texels.sum()),
        listed=int(texels[FIRST:].sum()) - palette.snapped,
        snapped=palette.snapped,
        black=int(texels[BLACK]),
        unlisted=int(texels[UNLISTED]),
        unlisted_colours=palette.count_unlisted(),
        faces=tally.faces,
        area=round(float(tally.area.sum()) + tally.uncoloured, 3),
        listed_area=round(float(tally.area[FIRST:].sum()), 3),
        unlisted_area=round(float(tally.area[:FIRST].sum()), 3),
        uncoloured_area=round(tally.uncoloured, 3),
        without_geometry=int((tally.area[FIRST:] == 0).sum()),
    )


class _Tally:
    """The sums over all faces, by label, and the cells that each label reaches."""

    def __init__(self, labels: int) -> None:
        self.area = np.zeros(labels)
        self.uncoloured = 0.0
        self.faces = 0
        self._moment = np.zeros((labels, 3))
        self._low, self._high = np.full((labels, 3), np.inf), np.full((labels, 3), -np.inf)
        self._cells: list[SurfaceCells] = []
        self._held = 0
        self._samples = 0

    def add(self, part: MeshPart, sheet: LabelSheet | None, palette: ColourLabels) -> None:
        """Add the faces of a part."""
        if np.abs(part.vertices).max(initial=0) > CELL * 2**15 - 1:
            raise MeshError("it is kilometres wide; are its units metres?")
        self.faces += len(part.faces)
        vertices = np.ascontiguousarray(part.vertices.T)
        vertex_labels = spots = None
        if sheet is None and part.colours is not None:
            vertex_labels = palette.label_vertices(part.colours)
        if sheet is not None and part.places is not None:
            spots = np.ascontiguousarray((part.places * sheet.labels.shape[::-1]).T)
        for start in range(0, len(part.faces), _BATCH):
            faces = np.ascontiguousarray(part.faces[start : start + _BATCH].T)
            if sheet is not None and spots is not None:
                labels, mixed = sheet.find_labels(spots, faces)
                self._add_whole(vertices, faces[:, ~mixed], labels[~mixed])
                divided = faces[:, mixed].T
                self._add_divided(part.vertices[divided], spots.T[divided], sheet.labels)
            elif vertex_labels is not None:
                three = vertex_labels[faces.T]
                mixed = (three[:, 0] != three[:, 1]) | (three[:, 0] != three[:, 2])
                self._add_whole(vertices, faces[:, ~mixed], three[~mixed, 0])
                self._add_thirds(part.vertices[faces[:, mixed].T], three[mixed])
            else:
                self.uncoloured += float(measure_areas(*take_corners(vertices, faces)).sum())

    def _add_whole(self, vertices: Floats, faces: Ints, labels: Labels) -> None:
        """Add faces `[3, F]` of one label each, of vertices `[3, V]`."""
        a, b, c = take_corners(vertices, faces)
        self._add_moments(labels, measure_areas(a, b, c), (a + b + c) / 3)
        low, high = find_spans(a, b, c)
        self._extend(labels, low, high)
        # A vertex is noted once, for the last of its faces; faces of another label note theirs.
        last = np.zeros(vertices.shape[1], dtype=np.uint16)
        for corner in faces:
            last[corner] = labels
        self._reach(vertices, last)
        for corner in faces:
            other = last[corner] != labels
            self._reach(vertices[:, corner[other]], labels[other])
        x, y, z = high - low
        long = np.flatnonzero(x * x + y * y + z * z > CELL**2)  # no side is longer than this
        parts = np.ceil(find_longest(a[:, long], b[:, long], c[:, long]) / CELL)
        for chosen, weights, _ in self._subdivide(parts):
            points = weights @ vertices.T[faces[:, long[chosen]].T]
            self._reach(points.reshape(-1, 3).T, np.repeat(labels[long[chosen]], len(weights)))

    def _add_divided(self, corners: Floats, spots: Floats, sheet: Labels) -> None:
        """Add faces `[F, 3, 3]` that straddle labels: equal pieces, each its texel's."""
        first, second = spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0]
        texels = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
        texels = np.minimum(texels, sheet.size)  # a texture that repeats tells nothing new
        a, b, c = split_corners(corners)
        areas, longest = measure_areas(a, b, c), find_longest(a, b, c)
        parts = np.maximum(np.ceil(np.sqrt(_FINE * texels)), np.ceil(longest / CELL))
        parts = np.clip(parts, 2, 2 * max(sheet.shape))
        for faces, weights, pieces in self._subdivide(parts):
            points = np.ascontiguousarray((weights @ corners[faces]).reshape(-1, 3).T)
            spot = np.floor((weights @ spots[faces]).reshape(-1, 2)).astype(np.int64)
            labels = sheet[spot[:, 1] % sheet.shape[0], spot[:, 0] % sheet.shape[1]]
            area = np.repeat(areas[faces] / pieces, len(weights))
            self._add_moments(labels, area, points)
            self._extend(labels, points, points)
            self._reach(points, labels)

    def _add_thirds(self, corners: Floats, labels: Labels) -> None:
        """Add faces of several vertex labels: the third nearest to each vertex is that label's."""
        centre = corners.mean(axis=1)
        areas = measure_areas(*split_corners(corners)) / 3
        for corner in range(3):
            own, one, other = (corners[:, (corner + k) % 3] for k in range(3))
            ends = [own, (own + one) / 2, centre, (own + other) / 2]  # of that third
            low, high = np.min(ends, axis=0).T, np.max(ends, axis=0).T
            middle = (22 * own + 7 * (one + other)) / 36  # its centroid
            self._add_moments(labels[:, corner], areas, middle.T)
            self._extend(labels[:, corner], low, high)
            for end in ends:
                self._reach(end.T, labels[:, corner])

    def _subdivide(self, parts: Floats) -> Iterator[tuple[Ints, Floats, int]]:
        """Group faces by the number of parts that their sides are cut into.

        Yields:
            faces that are cut alike `[G]`; centroids of some of their n² small triangles as
            weights of the corners `[S, 3]`; and n². G times S is never much above `_BATCH`.
        """
        self._samples += int((parts**2).sum())
        if self._samples > _MOST_SAMPLES:
            raise MeshError("its faces are too large, or cover their textures too often")
        parts = np.where(parts > 16, np.ceil(parts / 8) * 8, parts).astype(np.int64)  # few groups
        for n in np.unique(parts):
            faces = np.flatnonzero(parts == n)
            step = max(1, _BATCH // (2 * int(n)))
            for row in range(0, int(n), step):
                weights = divide_triangle(int(n), row, min(row + step, int(n)))
                batch = max(1, _BATCH // len(weights))
                for start in range(0, len(faces), batch):
                    yield faces[start : start + batch], weights, int(n) ** 2

    def _add_moments(self, labels: Labels, area: Floats, points: Floats) -> None:
        """Add areas `[P]` at points `[3, P]`."""
        self.area += np.bincount(labels, area, minlength=len(self.area))
        for axis in range(3):
            moment = np.bincount(labels, area * points[axis], minlength=len(self.area))
            self._moment[:, axis] += moment

    def _extend(self, labels: Labels, low: Floats, high: Floats) -> None:
        """Widen the boxes of labels `[P]` by those from `low` to `high`, `[3, P]` each."""
        if not len(labels):
            return
        starts, named = find_runs(labels)  # neighbours mostly have one label
        low = np.minimum.reduceat(low, starts, axis=1).T
        high = np.maximum.reduceat(high, starts, axis=1).T
        np.minimum.at(self._low, named, low)
        np.maximum.at(self._high, named, high)

    def _reach(self, points: Floats, labels: Labels) -> None:
        """Note the cells that points `[3, P]` of instances lie in."""
        listed = labels >= FIRST
        self._cells.append(SurfaceCells.of_points(points[:, listed], labels[listed]))
        self._held += len(self._cells[-1].keys)
        if self._held > _MOST_CELLS:
            self._cells = [join_cells(self._cells)]
            self._held = len(self._cells[0].keys)
            if self._held > _MOST_CELLS:
                raise MeshError("its surface is larger than that of any building")

    def refuse_strangers(self) -> None:
        """Refuse a mesh that does not show the instances that its annotation lists."""
        coloured, listed = float(self.area.sum()), float(self.area[FIRST:].sum())
        whole = coloured + self.uncoloured
        if not whole > 0:
            raise MeshError("its triangles have no area")
        if self.uncoloured > 0.5 * whole:
            raise MeshError(
                f"{self.uncoloured / whole:.0%} of its surface has neither a texture "
                "with coordinates nor vertex colours: not a semantic mesh"
            )
        if not listed >= _OWN_SHARE * whole:
            raise MeshError(
                f"only {listed / whole:.0%} of its surface has a colour that the "
                "annotation lists: it is another scene's, or not a semantic mesh"
            )

    def summarise(self, coverage: MeshCoverage) -> MeshSurvey:
        """Return what was measured of every instance."""
        area = self.area[FIRST:]
        there = area > 0
        nothing = np.where(there, 1.0, np.nan)[:, None]
        cells = keep_largest_parts(join_cells(self._cells))
        owner = (cells.keys >> np.uint64(48)).astype(np.int64) - FIRST
        starts, named = find_runs(owner)
        part_box = np.full((len(area), 2, 3), np.nan)
        if len(owner):
            part_box[named, 0] = np.minimum.reduceat(cells.low, starts, axis=0)
            part_box[named, 1] = np.maximum.reduceat(cells.high, starts, axis=0)
        box = np.stack([self._low[FIRST:], self._high[FIRST:]], axis=1)
        return MeshSurvey(
            area=area,
            centroid=self._moment[FIRST:] / np.where(there, area, 1.0)[:, None] * nothing,
            box=np.where(there[:, None, None], box, np.nan),
            part_box=part_box,
            cells=np.stack([cells.low, cells.high], axis=1),
            owner=owner,
            coverage=coverage,
        )
