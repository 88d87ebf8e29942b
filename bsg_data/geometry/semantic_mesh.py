"""Measure every instance of a `semantic.glb`: the surface that has its colour.

In HM3D's semantic meshes every texel has the exact colour of an instance, so the texture decides
and never an average of colours: a face of one colour counts whole, a face that straddles instances
is divided among them texel by texel. Vertex colours stand in where there is no texture. All is
measured in the axes of the file; `bsg_data.geometry.placement` turns it upright.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import groupby
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
import numpy.typing as npt
from PIL import Image

from bsg_data.files import hash_file
from bsg_data.geometry.gltf import MeshError, MeshPart, read_parts
from bsg_data.scene.mesh_coverage import MeshCoverage

Floats = npt.NDArray[np.float64]
Ints = npt.NDArray[np.int64]
Labels = npt.NDArray[np.uint16]
Integer = TypeVar("Integer", bound=np.integer[Any])

UNLISTED, BLACK = 0, 1  # labels that are no instance; those of instances follow
_FIRST = 2
MAX_INSTANCES = 60_000
CELL = 0.1  # metres; what is closer than two of these is one part
_FINE = 4.0  # samples a texel where a face straddles instances
_MOST_SAMPLES = 1_000_000_000  # of one mesh: some minutes
_BATCH = 2**19  # samples or faces in memory
_MOST_CELLS = 8_000_000  # of one mesh: 80,000 square metres
_OWN_SHARE = 0.2  # of its colours' surface that a mesh must have listed to be its scene's


@dataclass(frozen=True, slots=True)
class MeshSurvey:
    """The surface of every listed instance, in the axes of the file; metres.

    Attributes:
        area: `[I]`, square metres; 0 without geometry.
        centroid: `[I, 3]`, weighted by area; NaN without geometry.
        box: `[I, 2, 3]`, lowest and highest corner; NaN without geometry.
        part_box: `[I, 2, 3]`, of the largest connected part.
        cells: `[P, 2, 3]`, the largest parts in pieces: boxes of what lies in a cell of `CELL`.
        owner: `[P]`, the instance of each piece.
        coverage: what the annotation explains.
    """

    area: Floats
    centroid: Floats
    box: Floats
    part_box: Floats
    cells: Floats
    owner: Ints
    coverage: MeshCoverage


def survey_mesh(
    path: Path, colours: Sequence[str], *, snap_colours: int | None = None
) -> MeshSurvey:
    """Measure the instances of a mesh.

    Args:
        path: a GLB.
        colours: RRGGBB of the instances, in order `[I]`.
        snap_colours: take a texel of a JPEG texture for the nearest instance's if no channel
            differs by more (0..255); None refuses JPEG.

    Raises:
        MeshError: if the file cannot be read, is JPEG unasked, or is another scene's.
    """
    try:
        return _survey(path, colours, snap_colours)
    except MemoryError as error:
        raise MeshError(f"{path}: needs more memory than there is") from error


def _survey(path: Path, colours: Sequence[str], snap_colours: int | None) -> MeshSurvey:
    palette = _Palette(colours, snap_colours)
    tally = _Tally(len(colours) + _FIRST, path)
    texels = np.zeros(len(colours) + _FIRST, dtype=np.int64)
    for _, parts in groupby(read_parts(path), key=lambda part: id(part.texture)):
        sheet = None
        for part in parts:
            if part.texture is not None and sheet is None:
                sheet = palette.label(part.texture, path)
                texels += np.bincount(sheet.ravel(), minlength=len(texels))
            tally.add(part, sheet, palette)
    tally.refuse_strangers()
    return tally.summarise(_cover(tally, texels, palette, sha256=hash_file(path)))


def _cover(tally: _Tally, texels: Ints, palette: _Palette, *, sha256: str) -> MeshCoverage:
    return MeshCoverage(
        sha256=sha256,
        texels=palette.texels,
        listed=int(texels[_FIRST:].sum()) - palette.snapped,
        snapped=palette.snapped,
        black=int(texels[BLACK]),
        unlisted=int(texels[UNLISTED]),
        unlisted_colours=palette.count_unlisted(),
        faces=tally.faces,
        area=round(float(tally.area.sum()) + tally.uncoloured, 3),
        listed_area=round(float(tally.area[_FIRST:].sum()), 3),
        unlisted_area=round(float(tally.area[:_FIRST].sum()), 3),
        uncoloured_area=round(tally.uncoloured, 3),
        without_geometry=int((tally.area[_FIRST:] == 0).sum()),
    )


class _Palette:
    """The label of every colour."""

    def __init__(self, colours: Sequence[str], snap: int | None) -> None:
        if len(colours) > MAX_INSTANCES:
            raise MeshError(f"{len(colours):,} instances; at most {MAX_INSTANCES:,} are told apart")
        codes = np.array([int(colour, 16) for colour in colours], dtype=np.int64)
        self._rgb = np.stack([codes >> 16, codes >> 8 & 255, codes & 255], axis=1)
        self._labels = np.zeros(2**24, dtype=np.uint16)
        self._labels[0] = BLACK
        self._labels[_codes(self._rgb)] = np.arange(_FIRST, _FIRST + len(colours))
        self._unlisted = np.zeros(2**24, dtype=bool)
        self._snap = snap
        self.texels = 0
        self.snapped = 0

    def label(self, image: Image.Image, path: Path) -> Labels:
        """Return the label of every texel `[H, W]` by its exact colour."""
        self.texels += image.width * image.height
        if image.format == "JPEG":
            return self._snap_jpeg(image, path)
        pixels, table = _unpack(image, path)
        if table is not None:
            of_place = np.full(256, UNLISTED, dtype=np.uint16)  # also of places beyond the palette
            of_place[: len(table)] = self._labels[table]
            used = np.bincount(pixels.ravel(), minlength=256)[: len(table)] > 0
            self._unlisted[table[used & (of_place[: len(table)] == UNLISTED)]] = True
            return np.asarray(of_place[pixels])
        labels = np.empty(pixels.shape, dtype=np.uint16)
        for row in range(0, len(pixels), 512):  # indexing needs eight bytes a texel
            codes = pixels[row : row + 512] & 0xFFFFFF
            looked_up = np.take(self._labels, codes)
            self._unlisted[codes[looked_up == UNLISTED]] = True
            labels[row : row + 512] = looked_up
        return labels

    def label_vertices(self, colours: npt.NDArray[np.uint8]) -> Labels:
        """Return the label of every vertex `[V]`."""
        codes = _codes(colours)
        labels = self._labels[codes]
        self._unlisted[codes[labels == UNLISTED]] = True
        return labels

    def count_unlisted(self) -> int:
        """Return how many colours were met that no instance has."""
        return int(self._unlisted.sum())

    def _snap_jpeg(self, image: Image.Image, path: Path) -> Labels:
        from scipy.spatial import cKDTree  # slow to import, and JPEG is rare

        if self._snap is None:
            raise MeshError(
                f"{path}: a texture is JPEG, which changes colours, so that texels no longer say "
                "which instance they are; --snap-colours N takes the nearest listed colour within N"
            )
        codes, index = np.unique(_unpack(image, path)[0] & 0xFFFFFF, return_inverse=True)
        rgb = np.stack([codes & 255, codes >> 8 & 255, codes >> 16], axis=1)
        _, nearest = cKDTree(self._rgb).query(rgb, p=np.inf, distance_upper_bound=self._snap + 0.5)
        exact = self._labels[codes]
        near = nearest < len(self._rgb)
        labels = np.where(near, nearest + _FIRST, exact).astype(np.uint16)
        self._unlisted[codes[labels == UNLISTED]] = True
        self.snapped += int((near & (exact < _FIRST))[index].sum())
        return labels[index].reshape(image.height, image.width)


def _codes(rgb: npt.NDArray[np.generic]) -> npt.NDArray[np.uint32]:
    """Return colours `[..., 3]` as whole numbers, red lowest: the order of bytes in memory."""
    red, green, blue = (rgb[..., channel].astype(np.uint32) for channel in range(3))
    return np.asarray(red | green << 8 | blue << 16, dtype=np.uint32)


def _unpack(
    image: Image.Image, path: Path
) -> tuple[npt.NDArray[np.unsignedinteger], npt.NDArray[np.uint32] | None]:
    """Return the pixels `[H, W]` and let go of the image.

    These are places in the palette, returned with the codes of its colours, or codes.
    """
    if image.mode not in ("1", "L", "LA", "P", "PA", "RGB", "RGBA"):
        raise MeshError(f"{path}: a texture has mode {image.mode}; expected 8 bits a channel")
    try:
        if image.mode == "P":
            palette = np.array(image.getpalette("RGB"), dtype=np.uint8)
            return np.asarray(image), _codes(palette.reshape(-1, 3))
        four = np.ascontiguousarray(np.asarray(image.convert("RGBA")))
        return four.view("<u4")[..., 0], None
    except (OSError, SyntaxError, ValueError) as error:
        raise MeshError(f"{path}: a texture is damaged ({str(error)[:100]})") from error
    finally:
        image.close()


class _Tally:
    """The sums over all faces, by label, and the cells that each label reaches."""

    def __init__(self, labels: int, path: Path) -> None:
        self._path = path
        self.area = np.zeros(labels)
        self.uncoloured = 0.0
        self.faces = 0
        self._moment = np.zeros((labels, 3))
        self._low, self._high = np.full((labels, 3), np.inf), np.full((labels, 3), -np.inf)
        self._cells: list[_Cells] = []
        self._held = 0
        self._samples = 0

    def add(self, part: MeshPart, sheet: Labels | None, palette: _Palette) -> None:
        """Add the faces of a part."""
        if np.abs(part.vertices).max(initial=0) > CELL * 2**15 - 1:
            raise MeshError(f"{self._path}: it is kilometres wide; are its units metres?")
        self.faces += len(part.faces)
        vertex_labels = None
        if sheet is None and part.colours is not None:
            vertex_labels = palette.label_vertices(part.colours)
        changes = spots = None
        if sheet is not None and part.places is not None:
            changes, spots = _sum_changes(sheet), part.places * sheet.shape[::-1]
        for start in range(0, len(part.faces), _BATCH):
            faces = part.faces[start : start + _BATCH]
            if sheet is not None and changes is not None and spots is not None:
                labels, mixed = _label_faces(spots, faces, sheet, changes)
                self._add_whole(part.vertices, faces[~mixed], labels[~mixed])
                self._add_divided(part.vertices[faces[mixed]], spots[faces[mixed]], sheet)
            elif vertex_labels is not None:
                three = vertex_labels[faces]
                mixed = (three[:, 0] != three[:, 1]) | (three[:, 0] != three[:, 2])
                self._add_whole(part.vertices, faces[~mixed], three[~mixed, 0])
                self._add_thirds(part.vertices[faces[mixed]], three[mixed])
            else:
                self.uncoloured += float(_areas(*_corners(part.vertices, faces)).sum())

    def _add_whole(self, vertices: Floats, faces: Ints, labels: Labels) -> None:
        """Add faces `[F, 3]` of one label each."""
        a, b, c = _corners(vertices, faces)
        self._add_moments(labels, _areas(a, b, c), (a + b + c) / 3)
        low, high = _spans(a, b, c)
        self._extend(labels, low, high)
        # A vertex is noted once, for the last of its faces; faces of another label note theirs.
        last = np.zeros(len(vertices), dtype=np.uint16)
        for corner in range(3):
            last[faces[:, corner]] = labels
        self._reach(vertices, last)
        for corner in range(3):
            other = last[faces[:, corner]] != labels
            self._reach(vertices[faces[other, corner]], labels[other])
        x, y, z = (high - low).T
        long = np.flatnonzero(x * x + y * y + z * z > CELL**2)  # no side is longer than this
        parts = np.ceil(_longest(a[long], b[long], c[long]) / CELL)
        for chosen, weights, _ in self._subdivide(parts):
            points = weights @ vertices[faces[long[chosen]]]
            self._reach(points.reshape(-1, 3), np.repeat(labels[long[chosen]], len(weights)))

    def _add_divided(self, corners: Floats, spots: Floats, sheet: Labels) -> None:
        """Add faces `[F, 3, 3]` that straddle labels: equal pieces, each its texel's."""
        first, second = spots[:, 1] - spots[:, 0], spots[:, 2] - spots[:, 0]
        texels = np.abs(first[:, 0] * second[:, 1] - first[:, 1] * second[:, 0]) / 2
        texels = np.minimum(texels, sheet.size)  # a texture that repeats tells nothing new
        areas, longest = _areas(*_split(corners)), _longest(*_split(corners))
        parts = np.maximum(np.ceil(np.sqrt(_FINE * texels)), np.ceil(longest / CELL))
        parts = np.clip(parts, 2, 2 * max(sheet.shape))
        for faces, weights, pieces in self._subdivide(parts):
            points = (weights @ corners[faces]).reshape(-1, 3)
            spot = np.floor((weights @ spots[faces]).reshape(-1, 2)).astype(np.int64)
            labels = sheet[spot[:, 1] % sheet.shape[0], spot[:, 0] % sheet.shape[1]]
            area = np.repeat(areas[faces] / pieces, len(weights))
            self._add_moments(labels, area, points)
            self._extend(labels, points, points)
            self._reach(points, labels)

    def _add_thirds(self, corners: Floats, labels: Labels) -> None:
        """Add faces of several vertex labels: the third nearest to each vertex is that label's."""
        centre = corners.mean(axis=1)
        areas = _areas(*_split(corners)) / 3
        for corner in range(3):
            own, one, other = (corners[:, (corner + k) % 3] for k in range(3))
            ends = [own, (own + one) / 2, centre, (own + other) / 2]  # of that third
            low, high = np.min(ends, axis=0), np.max(ends, axis=0)
            middle = (22 * own + 7 * (one + other)) / 36  # its centroid
            self._add_moments(labels[:, corner], areas, middle)
            self._extend(labels[:, corner], low, high)
            for end in ends:
                self._reach(end, labels[:, corner])

    def _subdivide(self, parts: Floats) -> Iterator[tuple[Ints, Floats, int]]:
        """Group faces by the number of parts that their sides are cut into.

        Yields:
            faces that are cut alike `[G]`; centroids of some of their n² small triangles as
            weights of the corners `[S, 3]`; and n². G times S is never much above `_BATCH`.
        """
        self._samples += int((parts**2).sum())
        if self._samples > _MOST_SAMPLES:
            raise MeshError(
                f"{self._path}: its faces are too large, or cover their textures too often"
            )
        parts = np.where(parts > 16, np.ceil(parts / 8) * 8, parts).astype(np.int64)  # few groups
        for n in np.unique(parts):
            faces = np.flatnonzero(parts == n)
            step = max(1, _BATCH // (2 * int(n)))
            for row in range(0, int(n), step):
                weights = _centroids(int(n), row, min(row + step, int(n)))
                batch = max(1, _BATCH // len(weights))
                for start in range(0, len(faces), batch):
                    yield faces[start : start + batch], weights, int(n) ** 2

    def _add_moments(self, labels: Labels, area: Floats, points: Floats) -> None:
        self.area += np.bincount(labels, area, minlength=len(self.area))
        for axis in range(3):
            moment = np.bincount(labels, area * points[:, axis], minlength=len(self.area))
            self._moment[:, axis] += moment

    def _extend(self, labels: Labels, low: Floats, high: Floats) -> None:
        if not len(labels):
            return
        order = np.argsort(labels, kind="stable")  # radix sort, for 16 bits
        starts, named = _runs(labels[order])
        self._low[named] = np.minimum(
            self._low[named], np.minimum.reduceat(low[order], starts, axis=0)
        )
        self._high[named] = np.maximum(
            self._high[named], np.maximum.reduceat(high[order], starts, axis=0)
        )

    def _reach(self, points: Floats, labels: Labels) -> None:
        """Note the cells that points `[P, 3]` of instances lie in."""
        listed = labels >= _FIRST
        points, labels = points[listed], labels[listed]
        x, y, z = (np.floor(points / CELL) + 2**15).astype(np.uint64).T
        keys = np.asarray(labels.astype(np.uint64) << 48 | x << 32 | y << 16 | z, dtype=np.uint64)
        self._cells.append(_Cells(keys, points, points).merge())
        self._held += len(self._cells[-1].keys)
        if self._held > _MOST_CELLS:
            self._cells = [_concatenate(self._cells)]
            self._held = len(self._cells[0].keys)
            if self._held > _MOST_CELLS:
                raise MeshError(f"{self._path}: its surface is larger than that of any building")

    def refuse_strangers(self) -> None:
        """Refuse a mesh that does not show the instances that its annotation lists."""
        coloured, listed = float(self.area.sum()), float(self.area[_FIRST:].sum())
        whole = coloured + self.uncoloured
        if not whole > 0:
            raise MeshError(f"{self._path}: its triangles have no area")
        if self.uncoloured > 0.5 * whole:
            raise MeshError(
                f"{self._path}: {self.uncoloured / whole:.0%} of its surface has neither a texture "
                "with coordinates nor vertex colours: not a semantic mesh"
            )
        if not listed >= _OWN_SHARE * whole:
            raise MeshError(
                f"{self._path}: only {listed / whole:.0%} of its surface has a colour that the "
                "annotation lists: it is another scene's, or not a semantic mesh"
            )

    def summarise(self, coverage: MeshCoverage) -> MeshSurvey:
        """Return what was measured of every instance."""
        area = self.area[_FIRST:]
        there = area > 0
        nothing = np.where(there, 1.0, np.nan)[:, None]
        cells = _largest_parts(_concatenate(self._cells))
        owner = (cells.keys >> np.uint64(48)).astype(np.int64) - _FIRST
        starts, named = _runs(owner)
        part_box = np.full((len(area), 2, 3), np.nan)
        if len(owner):
            part_box[named, 0] = np.minimum.reduceat(cells.low, starts, axis=0)
            part_box[named, 1] = np.maximum.reduceat(cells.high, starts, axis=0)
        box = np.stack([self._low[_FIRST:], self._high[_FIRST:]], axis=1)
        return MeshSurvey(
            area=area,
            centroid=self._moment[_FIRST:] / np.where(there, area, 1.0)[:, None] * nothing,
            box=np.where(there[:, None, None], box, np.nan),
            part_box=part_box,
            cells=np.stack([cells.low, cells.high], axis=1),
            owner=owner,
            coverage=coverage,
        )


@dataclass(frozen=True, slots=True)
class _Cells:
    """Cells of a grid by label: key `[P]`, and the box of the points in each, `[P, 3]` twice."""

    keys: npt.NDArray[np.uint64]
    low: Floats
    high: Floats

    def merge(self) -> _Cells:
        """Return every cell once, in the order of the keys."""
        if not len(self.keys):
            return self
        order = np.argsort(self.keys)
        starts, keys = _runs(self.keys[order])
        low = np.minimum.reduceat(self.low[order], starts, axis=0)
        return _Cells(keys, low, np.maximum.reduceat(self.high[order], starts, axis=0))


def _concatenate(cells: list[_Cells]) -> _Cells:
    if not cells:
        return _Cells(np.zeros(0, dtype=np.uint64), np.zeros((0, 3)), np.zeros((0, 3)))
    return _Cells(
        np.concatenate([one.keys for one in cells]),
        np.concatenate([one.low for one in cells]),
        np.concatenate([one.high for one in cells]),
    ).merge()


def _largest_parts(cells: _Cells) -> _Cells:
    """Keep the cells of the largest part of every label: cells that touch are of one part."""
    from scipy.sparse import coo_array  # Imported here because importing SciPy is slow.
    from scipy.sparse.csgraph import connected_components

    keys = cells.keys
    if not len(keys):
        return cells
    rows, columns = [], []
    for step in _NEIGHBOURS:
        place = np.searchsorted(keys, keys + step)
        met = keys[np.minimum(place, len(keys) - 1)] == keys + step
        rows.append(np.flatnonzero(met))
        columns.append(place[met])
    row, column = np.concatenate(rows), np.concatenate(columns)
    touching = coo_array((np.ones(len(row), bool), (row, column)), shape=(len(keys), len(keys)))
    _, part = connected_components(touching, directed=False)
    size = np.bincount(part)[part]
    starts, _ = _runs(keys >> np.uint64(48))
    most = np.maximum.reduceat(size, starts)
    counts = np.diff(np.append(starts, len(keys)))
    best = np.where(size == np.repeat(most, counts), part, part.max() + 1)
    kept = part == np.repeat(np.minimum.reduceat(best, starts), counts)  # ties: the first
    return _Cells(keys[kept], cells.low[kept], cells.high[kept])


# Half of the 26 neighbours of a cell, as differences of keys.
_NEIGHBOURS = tuple(
    np.uint64(x * 2**32 + y * 2**16 + z)
    for x in (0, 1)
    for y in (-1, 0, 1)
    for z in (-1, 0, 1)
    if (x, y, z) > (0, 0, 0)
)


def _runs(values: npt.NDArray[Integer]) -> tuple[Ints, npt.NDArray[Integer]]:
    """Return where each run of equal values starts, and its value."""
    starts = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))[: len(values)]
    return starts, values[starts]


def _corners(points: Floats, faces: Ints) -> tuple[Floats, Floats, Floats]:
    """Return the corners of faces, `[F, D]` each: sums over three arrays beat an axis of three."""
    return points[faces[:, 0]], points[faces[:, 1]], points[faces[:, 2]]


def _split(corners: Floats) -> tuple[Floats, Floats, Floats]:
    return corners[:, 0], corners[:, 1], corners[:, 2]


def _spans(a: Floats, b: Floats, c: Floats) -> tuple[Floats, Floats]:
    """Return the lowest and the highest corner of triangles."""
    return np.minimum(np.minimum(a, b), c), np.maximum(np.maximum(a, b), c)


def _areas(a: Floats, b: Floats, c: Floats) -> Floats:
    (ux, uy, uz), (vx, vy, vz) = (b - a).T, (c - a).T
    x, y, z = uy * vz - uz * vy, uz * vx - ux * vz, ux * vy - uy * vx
    return np.asarray(np.sqrt(x * x + y * y + z * z) / 2)


def _longest(a: Floats, b: Floats, c: Floats) -> Floats:
    """Return the longest side of every triangle."""
    sides = [np.einsum("ij,ij->i", side, side) for side in (b - a, c - b, a - c)]
    return np.asarray(np.sqrt(np.maximum(np.maximum(sides[0], sides[1]), sides[2])))


def _sum_changes(sheet: Labels) -> npt.NDArray[np.int32]:
    """Return the number of texels above and left of each, which differ from the one before them."""
    change = np.zeros(sheet.shape, dtype=bool)
    change[:, 1:] = sheet[:, 1:] != sheet[:, :-1]
    change[1:] |= sheet[1:] != sheet[:-1]
    sums = np.zeros((sheet.shape[0] + 1, sheet.shape[1] + 1), dtype=np.int32)
    sums[1:, 1:] = change
    np.cumsum(sums, axis=1, out=sums)
    for row in range(1, len(sums)):  # a cumsum down the columns takes ten times as long
        sums[row] += sums[row - 1]
    return sums


def _label_faces(
    spots: Floats, faces: Ints, sheet: Labels, changes: npt.NDArray[np.int32]
) -> tuple[Labels, npt.NDArray[np.bool_]]:
    """Return the label at a corner of every face, and whether its texels may differ.

    Args:
        spots: column and row of the vertices `[V, 2]`, in texels.
        faces: `[F, 3]`.
        sheet: labels `[H, W]`.
        changes: of `_sum_changes`.
    """
    bounds, beyond = [], np.zeros(len(faces), dtype=bool)
    for axis, size in ((1, sheet.shape[0]), (0, sheet.shape[1])):
        low, high = _spans(*_corners(spots[:, axis], faces))
        turns = np.floor(low / size) * size  # textures repeat
        first = np.minimum((low - turns).astype(np.int32), size - 1)
        last = np.maximum(np.ceil(high - turns).astype(np.int32), first + 1)
        beyond |= last > size
        bounds += [first, np.minimum(last, size)]
    top, below, left, right = bounds
    inside = changes[below, right] - changes[top, right] - changes[below, left] + changes[top, left]
    return sheet[top, left], beyond | (inside > 0)


def _centroids(n: int, start: int, stop: int) -> Floats:
    """Return centroids of the small triangles of a triangle cut n times, as weights `[..., 3]`.

    There are n² in n rows; these are of rows `start` to `stop`.
    """
    rows, columns = np.meshgrid(np.arange(start, stop), np.arange(n), indexing="ij")
    row, column = rows.ravel(), columns.ravel()
    upright, flipped = row + column < n, row + column < n - 1
    first = np.stack([row[upright] + 1 / 3, column[upright] + 1 / 3], axis=1)
    second = np.stack([row[flipped] + 2 / 3, column[flipped] + 2 / 3], axis=1)
    two = np.concatenate([first, second]) / n
    return np.concatenate([1 - two.sum(axis=1, keepdims=True), two], axis=1)
