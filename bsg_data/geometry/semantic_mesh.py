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

from bsg_data.arrays import Bools, Floats, Ints, find_runs
from bsg_data.geometry.colour_labels import BLACK, FIRST, UNLISTED, ColourLabels, LabelSheet
from bsg_data.geometry.gltf import MeshError, MeshPart, naming, read_parts
from bsg_data.geometry.surfaces import (
    BLOCK,
    CELL,
    Labels,
    SurfaceCells,
    divide_triangle,
    find_longest,
    find_spans,
    join_cells,
    keep_largest_parts,
    measure_areas,
    take_corners,
)
from bsg_data.inputs.bounded_file import hash_file
from bsg_data.scene.scene_graph import MeshCoverage

_FINE = 4.0  # samples a texel where a face straddles instances
_MOST_SAMPLES = 1_000_000_000  # of one mesh: some minutes
_BATCH = 2**19  # faces in memory
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
    path: Path, colours: Sequence[str | None], *, snap_colours: int | None = None
) -> MeshSurvey:
    """Measure the instances of a mesh: a GLB, and the colours RRGGBB of its instances `[I]`.

    An instance without a colour, None, gets no surface. With `snap_colours`, a texel of a JPEG
    texture counts as the nearest instance's if no channel differs by more (0..255).

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
        self._totals = np.zeros((4, labels))  # area, and area times x, y and z
        self.uncoloured = 0.0
        self.faces = 0
        self._cells: list[SurfaceCells] = []
        self._held = 0
        self._samples = 0

    @property
    def area(self) -> Floats:
        """The surface of every label, square metres."""
        return np.asarray(self._totals[0])

    def add(self, part: MeshPart, sheet: LabelSheet | None, palette: ColourLabels) -> None:
        """Add the faces of a part."""
        vertices = part.vertices
        if np.abs(vertices).max(initial=0) > CELL * 2**15 - 1:
            raise MeshError("it is kilometres wide; are its units metres?")
        self.faces += part.faces.shape[1]
        for start in range(0, part.faces.shape[1], _BATCH):
            faces = part.faces[:, start : start + _BATCH]
            if part.places is not None and sheet is not None:
                spots = part.places * np.array(sheet.labels.shape)[::-1, None]
                labels, mixed = sheet.find_labels(spots, faces)
                self._add_whole(vertices, faces, labels, mixed)
                divided = faces.compress(mixed, axis=1)
                self._add_divided(vertices[:, divided], spots[:, divided], sheet.labels)
            elif part.colours is not None:
                three = palette.label_vertices(part.colours)[faces]
                mixed = (three[0] != three[1]) | (three[0] != three[2])
                self._add_whole(vertices, faces, three[0], mixed)
                self._add_thirds(vertices[:, faces[:, mixed]], three[:, mixed])
            else:
                a, b, c = take_corners(vertices, faces)
                self.uncoloured += float(measure_areas(b - a, c - a).sum())

    def _add_whole(self, vertices: Floats, faces: Ints, labels: Labels, mixed: Bools) -> None:
        """Add faces `[3, F]` of one label each, of vertices `[3, V]`; leave the mixed ones out."""
        long = []
        for start in range(0, len(labels), BLOCK):
            some = slice(start, start + BLOCK)
            a, b, c = take_corners(vertices, faces[:, some])
            u, v = b - a, c - a
            areas = measure_areas(u, v)
            areas[mixed[some]] = 0
            self._add_moments(labels[some], areas, (a + b + c) / 3)
            # Twice this is at least the square of the diagonal of the box, which no side exceeds.
            square = np.einsum("af,af->f", u, u) + np.einsum("af,af->f", v, v)
            long.append(start + np.flatnonzero((square > CELL**2 / 2.01) & ~mixed[some]))
        labels = np.where(mixed, UNLISTED, labels).astype(np.uint16)
        # A vertex is noted once, for the last of its faces; faces of another label note theirs.
        last = np.zeros(vertices.shape[1], dtype=np.uint16)
        for corner in faces:
            last[corner] = labels
        self._reach(vertices, last)
        for corner in faces:
            other = np.flatnonzero(last.take(corner) != labels)
            self._reach(vertices.take(corner[other], axis=1), labels[other])
        chosen = np.concatenate(long)
        low, high = find_spans(*take_corners(vertices, faces[:, chosen]))
        chosen = chosen[((high - low) ** 2).sum(axis=0) > CELL**2]
        corners = vertices[:, faces[:, chosen]]
        parts = np.ceil(find_longest(*corners.transpose(1, 0, 2)) / CELL)
        for group, weights, _ in self._subdivide(parts):
            points = _spread(corners[:, :, group], weights)
            self._reach(points, np.repeat(labels[chosen[group]], len(weights)))

    def _add_divided(self, corners: Floats, spots: Floats, sheet: Labels) -> None:
        """Add faces that straddle labels, corners `[3, 3, F]`: equal pieces, each its texel's."""
        first, second = spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0]
        texels = np.abs(first[0] * second[1] - first[1] * second[0]) / 2
        texels = np.minimum(texels, sheet.size)  # a texture that repeats tells nothing new
        a, b, c = corners.transpose(1, 0, 2)
        areas, longest = measure_areas(b - a, c - a), find_longest(a, b, c)
        parts = np.maximum(np.ceil(np.sqrt(_FINE * texels)), np.ceil(longest / CELL))
        parts = np.clip(parts, 2, 2 * max(sheet.shape))
        for faces, weights, pieces in self._subdivide(parts):
            points = _spread(corners[:, :, faces], weights)
            column, row = np.floor(_spread(spots[:, :, faces], weights)).astype(np.int64)
            labels = sheet.take(row % sheet.shape[0] * sheet.shape[1] + column % sheet.shape[1])
            self._add_moments(labels, np.repeat(areas[faces] / pieces, len(weights)), points)
            self._reach(points, labels)

    def _add_thirds(self, corners: Floats, labels: Labels) -> None:
        """Add faces of several vertex labels: the third nearest to each vertex is that label's."""
        a, b, c = corners.transpose(1, 0, 2)
        centre, areas = (a + b + c) / 3, measure_areas(b - a, c - a) / 3
        for own, one, other, label in ((a, b, c, 0), (b, c, a, 1), (c, a, b, 2)):
            middle = (22 * own + 7 * (one + other)) / 36  # of that third
            self._add_moments(labels[label], areas, middle)
            for end in (own, (own + one) / 2, centre, (own + other) / 2):
                self._reach(end, labels[label])

    def _subdivide(self, parts: Floats) -> Iterator[tuple[Ints, Floats, int]]:
        """Group faces by the number of parts that their sides are cut into.

        Yields:
            faces that are cut alike `[G]`; centroids of some of their n² small triangles as
            weights of the corners `[S, 3]`; and n². G times S is never much above `BLOCK`.
        """
        self._samples += int((parts**2).sum())
        if self._samples > _MOST_SAMPLES:
            raise MeshError("its faces are too large, or cover their textures too often")
        parts = np.where(parts > 16, np.ceil(parts / 8) * 8, parts).astype(np.int64)  # few groups
        for n in np.unique(parts):
            faces = np.flatnonzero(parts == n)
            step = max(1, BLOCK // (2 * int(n)))
            for row in range(0, int(n), step):
                weights = divide_triangle(int(n), row, min(row + step, int(n)))
                batch = max(1, BLOCK // len(weights))
                for start in range(0, len(faces), batch):
                    yield faces[start : start + batch], weights, int(n) ** 2

    def _add_moments(self, labels: Labels, area: Floats, points: Floats) -> None:
        """Add areas `[P]` at points `[3, P]`."""
        starts, named = find_runs(labels)  # neighbours mostly have one label
        if not len(named):
            return
        for total, values in zip(self._totals, (area, *(area * points)), strict=True):
            total += np.bincount(named, np.add.reduceat(values, starts), minlength=len(total))

    def _reach(self, points: Floats, labels: Labels) -> None:
        """Note the cells that points `[3, P]` of instances lie in."""
        for start in range(0, len(labels), BLOCK):
            some = slice(start, start + BLOCK)
            cells = SurfaceCells.of_points(points[:, some], labels[some], first=FIRST)
            self._cells.append(cells)
            self._held += len(cells.keys)
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
        area, *moment = self._totals[:, FIRST:]
        there = area > 0
        cells = join_cells(self._cells)
        box = _surround(cells, len(area))
        cells = keep_largest_parts(cells)
        return MeshSurvey(
            area=area,
            centroid=np.where(there, moment, np.nan).T / np.where(there, area, 1.0)[:, None],
            box=np.where(there[:, None, None], box, np.nan),
            part_box=_surround(cells, len(area)),
            cells=np.stack([cells.low.T, cells.high.T], axis=1),
            owner=_find_owners(cells),
            coverage=coverage,
        )


def _spread(corners: Floats, weights: Floats) -> Floats:
    """Return points `[D, F · S]` in triangles, corners `[D, 3, F]`, by their weights `[S, 3]`."""
    return np.asarray(corners.swapaxes(1, 2) @ weights.T).reshape(len(corners), -1)


def _find_owners(cells: SurfaceCells) -> Ints:
    """Return the instance of every cell `[P]`."""
    return (cells.keys >> np.uint64(48)).astype(np.int64) - FIRST


def _surround(cells: SurfaceCells, instances: int) -> Floats:
    """Return the box around the cells of every instance `[I, 2, 3]`; NaN without any."""
    boxes = np.full((instances, 2, 3), np.nan)
    starts, named = find_runs(_find_owners(cells))
    if len(named):
        boxes[named, 0] = np.minimum.reduceat(cells.low, starts, axis=1).T
        boxes[named, 1] = np.maximum.reduceat(cells.high, starts, axis=1).T
    return boxes
