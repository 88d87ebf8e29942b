"""Synthetic buildings with painted meshes like HM3D's, and what is true of them beside each.

As in HM3D's files, every texel has the colour of an instance, triangles straddle instances, some
colours are listed and not painted, others painted and not listed, a few specks of an instance lie
where it is not, and either axis is up. `<hash>.truth.json` has metres, Z up; the keys are instance
ids, and connections are pairs of region ids:

    {"up_axis": "y", "connections": [[0, 3, "door"], [3, 7, "stairs"], ...],
     "instances": {"17": {"area": 2.16, "centroid": [x, y, z], "box": [[x, y, z], [x, y, z]],
                          "part": the box without specks, or null}, ...}}
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import numpy.typing as npt
import pandas as pd
import trimesh
from mesh_files import as_file, make_mesh
from PIL import Image

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.geometry.placement import CEILING, FLOOR, STAIRS
from bsg_data.scene.class_map import load_class_map
from bsg_data.synthetic.building import SyntheticObject, synthesise
from bsg_data.synthetic.buildings import write_synthetic
from bsg_data.synthetic.floor_plan import STOREY, FloorPlan, draw_floor_plan

_ON_WALLS = {"blinds", "curtain", "mirror", "painting", "photo", "picture", "tv", "window"}
# Width, depth and height in metres of what is large; all else is drawn small.
_SIZES = {
    "bed": (2.0, 1.6, 0.6),
    "couch": (2.0, 0.9, 0.8),
    "table": (1.4, 0.8, 0.75),
    "cabinet": (0.9, 0.5, 0.9),
    "chair": (0.5, 0.5, 0.9),
    "refrigerator": (0.7, 0.7, 1.8),
}
_UNLISTED = -1  # and below: colours that are painted and not listed
_DOOR = 2.0  # metres high
_SPECK = 0.12  # metres


class Size(NamedTuple):
    """How fine a mesh is: the side of a texel in metres, those of a quad and a page in texels."""

    texel: float
    quad: int
    page: int


class _Fixture(NamedTuple):
    label: int  # its instance id
    category: str
    room: int


class _Surface(NamedTuple):
    """A painted rectangle of texels, from a corner along two axes of the building."""

    room: int
    corner: Floats
    axes: tuple[int, int]  # of its columns and of its rows
    texels: npt.NDArray[np.int32]
    specks: Bools  # which of these are painted astray


SMALL, FULL = Size(0.02, 15, 512), Size(0.01, 4, 1024)  # FULL is as large as a real mesh


def write_painted(out: Path, *, scenes: int, seed: int, size: Size = SMALL) -> None:
    """Write synthetic buildings with a mesh and the truth beside each annotation."""
    paths = list(write_synthetic(out, scenes=scenes, seed=seed))
    for number, path in enumerate(paths):
        rows = synthesise(seed=seed, number=number).rows
        rng = np.random.default_rng((seed, number, 1))
        regions = sorted({row.region_id for row in rows if row.region_id >= 0})
        fixtures = _list_fixtures(rows, regions, rng)
        climbed = {fixture.room for fixture in fixtures if fixture.category in STAIRS}
        plan = draw_floor_plan(len(regions), with_stairs=climbed, rng=rng)
        surfaces = _Painter(plan, fixtures, size.texel, rng).paint()
        up_axis = "yz"[number % 2]
        scene = _make_scene(surfaces, _draw_colours(rows, rng), size, up_axis)
        path.with_suffix(".glb").write_bytes(scene.export(file_type="glb"))
        connections = [(regions[a], regions[b], kind) for a, b, kind in plan.connections()]
        truth = {"up_axis": up_axis, "connections": connections, "instances": {}}
        if size is SMALL:
            truth["instances"] = _measure(surfaces, size.texel)
        path.with_name(path.name.replace("semantic.txt", "truth.json")).write_text(
            json.dumps(truth), "utf-8"
        )


def _list_fixtures(
    rows: Sequence[SyntheticObject], regions: list[int], rng: np.random.Generator
) -> list[_Fixture]:
    """Return every instance with its category; those of no region are in any room."""
    class_map = load_class_map("hm3d45-v1")
    found = ((row, class_map.lookup(row.name)) for row in rows)
    return [
        _Fixture(
            row.instance_id,
            (entry and entry.category) or "",
            regions.index(row.region_id)
            if row.region_id in regions
            else int(rng.integers(len(regions))),
        )
        for row, entry in found
    ]


def _draw_colours(
    rows: Sequence[SyntheticObject], rng: np.random.Generator
) -> npt.NDArray[np.uint8]:
    """Return the colours by label `[L, 3]`; the last ones are those of unlisted labels."""
    colours = rng.integers(0, 256, (max(row.instance_id for row in rows) + 4, 3), dtype=np.uint8)
    colours[0] = 0
    for row in rows:
        colours[row.instance_id] = list(bytes.fromhex(str(row.colour).zfill(6)))
    return colours


class _Painter:
    """Paints a building room by room: what hangs on walls onto them, all else as cuboids."""

    def __init__(
        self, plan: FloorPlan, fixtures: list[_Fixture], texel: float, rng: np.random.Generator
    ) -> None:
        self._plan, self._fixtures, self._texel, self._rng = plan, fixtures, texel, rng

    def paint(self) -> list[_Surface]:
        surfaces = [one for room in range(len(self._plan.rooms)) for one in self._furnish(room)]
        surfaces += [one for stair in self._plan.stairs for one in self._climb(stair)]
        self._speckle(surfaces)
        return surfaces

    def _furnish(self, room: int) -> Iterator[_Surface]:
        box = self._plan.box(room)
        low, high = np.array(box.minimum), np.array(box.maximum)
        *walls, floor, ceiling = shell = self._cuboid(room, low, high - low, 0)
        here = [fixture for fixture in self._fixtures if fixture.room == room]
        for category, surfaces in ((FLOOR, [floor]), (CEILING, [ceiling]), ("wall", walls)):
            _share(surfaces, [f.label for f in here if f.category == category])
        rest = [f for f in here if f.category not in (FLOOR, CEILING, "wall", "door", *STAIRS)]
        for fixture in rest:
            if fixture.category in _ON_WALLS:
                self._hang(walls, fixture.label, (0.2, 1.2), (0.2, 1.1))
            elif self._rng.random() > 0.01:  # else listed, and nowhere to be seen
                yield from self._cuboid(room, *self._place(low, high, fixture), fixture.label)
        self._paint_doors(room, walls, [f.label for f in here if f.category == "door"])
        yield from shell

    def _cuboid(self, room: int, low: Floats, size: Floats, label: int) -> list[_Surface]:
        """Return the six faces, low and high along x, then y, then z."""
        low, faces = np.round(low / self._texel) * self._texel, []
        counts = np.maximum(np.round(size / self._texel).astype(int), 1)
        for axis, (column, row) in enumerate(((1, 2), (0, 2), (0, 1))):
            for far in (0, 1):
                corner = low + far * counts[axis] * self._texel * np.eye(3)[axis]
                texels = np.full((counts[row], counts[column]), label, dtype=np.int32)
                faces.append(_Surface(room, corner, (column, row), texels, texels != texels))
        return faces

    def _place(self, low: Floats, high: Floats, fixture: _Fixture) -> tuple[Floats, Floats]:
        """Return where a thing begins, and how large it is."""
        size = self._rng.lognormal(-1.6, 0.6, 3).clip(0.06, 1.2)
        if fixture.category in _SIZES:
            size = np.array(_SIZES[fixture.category]) * self._rng.uniform(0.85, 1.15, 3)
        size = np.minimum(size, high - low - 0.1)
        above = 0 if fixture.category in _SIZES else self._rng.choice([0, 0.75, 1.4])
        free = (high - low - size) * [1, 1, 0]
        return low + self._rng.uniform(0.02, 0.98, 3) * free + [0, 0, above], size

    def _hang(
        self,
        walls: list[_Surface],
        label: int,
        width: tuple[float, float],
        height: tuple[float, float],
    ) -> None:
        """Paint a rectangle somewhere on one of the walls."""
        texels = walls[int(self._rng.integers(len(walls)))].texels
        sides = []
        for length, limits in zip(texels.shape, (height, width), strict=True):
            side = min(length, round(self._rng.uniform(*limits) / self._texel))
            start = int(self._rng.integers(0, length - side + 1))
            sides.append(slice(start, start + side))
        texels[tuple(sides)] = label

    def _paint_doors(self, room: int, walls: list[_Surface], labels: list[int]) -> None:
        """Paint doors into doorways, and the others onto outer walls."""
        rooms, top = self._plan.rooms, round(_DOOR / self._texel)
        own = rooms[room]
        for door in self._plan.doorways:
            if room in door.rooms:
                other = rooms[door.rooms[0] if door.rooms[1] == room else door.rooms[1]]
                across = 1 - door.axis
                wall = walls[2 * across + (other.low[across] > own.low[across])]
                start, end = (round((s - own.low[door.axis]) / self._texel) for s in door.span)
                wall.texels[:top, start:end] = labels.pop(0) if labels else _UNLISTED - 1
        lowest, highest = (
            [f(getattr(one, end)[axis] for one in rooms) for axis in (0, 1)]
            for f, end in ((min, "low"), (max, "high"))
        )
        ends = own.low[0] - lowest[0], highest[0] - own.high[0]
        ends += own.low[1] - lowest[1], highest[1] - own.high[1]
        outer = [wall for wall, gap in zip(walls, ends, strict=True) if gap < 0.08]
        for label in labels:
            self._hang(outer or walls, label, (0.6, 0.9), (1.8, 2.0))

    def _climb(self, stair: Any) -> Iterator[_Surface]:
        """Yield stairs: blocks that rise from the floor of a room to the next storey."""
        listed = [f for f in self._fixtures if f.room in stair.rooms and f.category in STAIRS]
        label, room, steps = listed[0].label if listed else _UNLISTED, stair.rooms[0], 8
        low = np.array([*stair.rectangle.low, self._plan.storeys[room] * STOREY])
        size = np.array([*stair.rectangle.sides(), 0])
        axis = int(size.argmax())
        size[axis] /= steps
        for step in range(steps):
            size[2] = STOREY * (step + 1) / steps
            yield from self._cuboid(room, low + step * size * np.eye(3)[axis], size, label)

    def _speckle(self, surfaces: list[_Surface]) -> None:
        """Paint specks of a few large things onto walls of other rooms."""
        side = round(_SPECK / self._texel)
        walls = [s for s in surfaces if s.axes[1] == 2 and min(s.texels.shape) > 1.5 / self._texel]
        for fixture in self._fixtures:
            elsewhere = [wall for wall in walls if wall.room != fixture.room]
            if fixture.category in _SIZES and elsewhere and self._rng.random() < 0.1:
                wall = elsewhere[int(self._rng.integers(len(elsewhere)))]
                row, column = (int(self._rng.integers(0, n - side)) for n in wall.texels.shape)
                part = slice(row, row + side), slice(column, column + side)
                wall.texels[part], wall.specks[part] = fixture.label, True


def _share(surfaces: list[_Surface], labels: list[int]) -> None:
    """Share the columns of surfaces among instances."""
    ends = np.cumsum([0, *(surface.texels.shape[1] for surface in surfaces)])
    for surface, start, end in zip(surfaces, ends, ends[1:], strict=False):
        named = np.array(labels or [_UNLISTED])
        surface.texels[:] = named[np.arange(start, end) * len(named) // ends[-1]]


def _make_scene(
    surfaces: list[_Surface], colours: npt.NDArray[np.uint8], size: Size, up_axis: str
) -> trimesh.Scene:
    scene = trimesh.Scene()
    for room in sorted({surface.room for surface in surfaces}):
        pages = _paginate([one for one in surfaces if one.room == room], size)
        for number, tiles in enumerate(pages):
            labels = np.zeros((size.page, size.page), dtype=np.int32)
            for tile, row, column in tiles:  # each bleeds one texel into its margin
                rows, columns = tile.texels.shape
                part = labels[row - 1 : row + rows + 1, column - 1 : column + columns + 1]
                part[:] = np.pad(tile.texels, 1, mode="edge")
            image = Image.fromarray(colours[labels])
            used, places = np.unique(labels, return_inverse=True)
            if number % 2 == 0 and len(used) <= 256:
                image = Image.fromarray(places.astype(np.uint8), mode="P")
                image.putpalette(colours[used].tobytes())
            scene.add_geometry(_make_page(tiles, as_file(image, "PNG"), size, up_axis))
    return scene


_Tile = tuple[_Surface, int, int]  # a part of a surface, and the row and column where it begins


def _paginate(surfaces: list[_Surface], size: Size) -> Iterator[list[_Tile]]:
    """Cut surfaces into tiles and set these on shelves, page after page, with a margin of 1."""
    tiles = [tile for surface in surfaces for tile in _cut(surface, size.page // 2 - 2, size.texel)]
    page: list[_Tile] = []
    row = column = height = 0
    for tile in sorted(tiles, key=lambda tile: -tile.texels.shape[0]):
        rows, columns = (side + 2 for side in tile.texels.shape)
        if column + columns > size.page:
            row, column, height = row + height, 0, 0
        if row + rows > size.page:
            yield page
            page, row, column, height = [], 0, 0, 0
        page.append((tile, row + 1, column + 1))
        column, height = column + columns, max(height, rows)
    yield page


def _cut(surface: _Surface, most: int, texel: float) -> Iterator[_Surface]:
    for row in range(0, surface.texels.shape[0], most):
        for column in range(0, surface.texels.shape[1], most):
            part = surface.texels[row : row + most, column : column + most]
            corner = _at(surface, np.array([row]), np.array([column]), texel)[0]
            yield surface._replace(corner=corner, texels=part)


def _at(surface: _Surface, rows: Any, columns: Any, texel: float) -> Floats:
    """Return where rows and columns of a surface begin `[P, 3]`."""
    across, upward = (np.eye(3)[axis] for axis in surface.axes)
    found: Floats = surface.corner + texel * (columns[:, None] * across + rows[:, None] * upward)
    return found


def _make_page(tiles: list[_Tile], image: Image.Image, size: Size, up_axis: str) -> trimesh.Trimesh:
    points, places, faces, total = [], [], [], 0
    for tile, top, left in tiles:
        rows, columns = (np.append(np.arange(0, n, size.quad), n) for n in tile.texels.shape)
        row, column = (grid.ravel() for grid in np.meshgrid(rows, columns, indexing="ij"))
        points.append(_at(tile, row, column, size.texel))
        places.append(np.stack([column + left, row + top], axis=1) / size.page)
        faces.append(_quads(len(rows), len(columns)) + total)
        total += len(row)
    x, y, z = np.concatenate(points).T
    turned = np.stack([x, z, -y] if up_axis == "y" else [x, y, z], axis=1)
    return make_mesh(turned, np.concatenate(faces), np.concatenate(places), image)


def _quads(rows: int, columns: int) -> Ints:
    """Return the triangles `[F, 3]` of a grid of vertices."""
    first = (np.arange(rows - 1)[:, None] * columns + np.arange(columns - 1)).ravel()
    corner = first + columns + 1
    halves = (first, first + 1, corner), (first, corner, corner - 1)
    return np.concatenate([np.stack(half, axis=1) for half in halves])


def _measure(surfaces: list[_Surface], texel: float) -> dict[str, Any]:
    """Return what is true of every instance: of all its texels, and of those that are no specks."""
    found = pd.DataFrame([row for surface in surfaces for row in _list_spots(surface, texel)])
    found = found.astype({"label": int})
    ends = {**dict.fromkeys("abc", "min"), **dict.fromkeys("def", "max")}
    box, part = (
        {
            label: row.reshape(2, 3).tolist()
            for label, row in zip(one.index, one.to_numpy(), strict=True)
        }
        for one in (
            found.groupby("label").agg(ends),
            found[~found.speck].groupby("label").agg(ends),
        )
    )
    sums = found.groupby("label")[["texels", *"xyz"]].sum()
    return {
        str(label): {
            "area": texels * texel**2,
            "centroid": [value / texels for value in moments],
            "box": box[label],
            "part": part.get(label),
        }
        for label, texels, *moments in sums.itertuples()
    }


def _list_spots(surface: _Surface, texel: float) -> Iterator[dict[str, Any]]:
    """Yield the box, the number and the moments of the texels of every instance of a surface."""
    for label in np.unique(surface.texels[surface.texels > 0]).tolist():
        for speck in np.unique(surface.specks[surface.texels == label]).tolist():
            row, column = np.nonzero((surface.texels == label) & (surface.specks == speck))
            low = _at(surface, row.min(keepdims=True), column.min(keepdims=True), texel)[0]
            high = _at(surface, row.max(keepdims=True) + 1, column.max(keepdims=True) + 1, texel)[0]
            sums = _at(surface, row + 0.5, column + 0.5, texel).sum(axis=0)
            values = dict(zip("abcdefxyz", [*low, *high, *sums], strict=True))
            yield {"label": label, "speck": speck, "texels": len(row), **values}
