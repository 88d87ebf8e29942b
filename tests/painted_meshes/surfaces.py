"""Furnish the floor plan of a building: every listed instance becomes painted surfaces.

A surface is a rectangle of texels, each of which belongs to one instance. Walls, floors and
ceilings are surfaces of a room; doors, windows, pictures and rugs are painted on them, so that
triangles straddle; all else is a cuboid. What nobody listed is painted with colours that nobody
listed, a few listed instances get no surface, and a few specks of an instance are painted where it
is not.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from bsg_data.arrays import Bools, Floats
from bsg_data.geometry.placement import CEILING, FLOOR, STAIRS
from bsg_data.scene.scene_graph import Box
from bsg_data.synthetic.floor_plan import HEIGHT, STOREY, FloorPlan, Rectangle

Texels = npt.NDArray[np.int32]

UNLISTED = -1  # and below: colours that no instance has
_WITHOUT_SURFACE = 0.01  # share of the furniture that is listed and nowhere to be seen
_SPECKLED = 0.02  # share of the furniture with a speck of its colour elsewhere
_SPECK = 0.12  # metres
_WALL = "wall"
_FRAME = 0.08
_DOOR_HEIGHT = 2.0
_ON_WALLS = frozenset(
    {
        "blinds",
        "curtain",
        "light switch",
        "mirror",
        "painting",
        "photo",
        "picture",
        "poster",
        "radiator",
        "shower wall",
        "towel",
        "tv",
        "wall clock",
        "wall lamp",
        "window",
        "window frame",
    }
)
_ON_FLOORS = frozenset({"rug", "carpet", "doormat", "mat", "bath mat"})
_ON_CEILINGS = frozenset({"ceiling lamp", "chandelier", "ceiling light", "ceiling fan", "lamp"})
# Width, depth and height in metres of what is large; all else is drawn small.
_SIZES: Mapping[str, tuple[float, float, float]] = {
    "bed": (2.0, 1.6, 0.6),
    "couch": (2.0, 0.9, 0.8),
    "table": (1.4, 0.8, 0.75),
    "desk": (1.4, 0.7, 0.75),
    "wardrobe": (1.5, 0.6, 2.0),
    "cabinet": (0.9, 0.5, 0.9),
    "kitchen cabinet": (0.8, 0.5, 0.8),
    "refrigerator": (0.7, 0.7, 1.8),
    "bathtub": (1.7, 0.8, 0.6),
    "chair": (0.5, 0.5, 0.9),
    "armchair": (0.8, 0.8, 0.9),
    "shelf": (0.9, 0.3, 1.6),
    "toilet": (0.4, 0.6, 0.8),
    "sink": (0.6, 0.5, 0.3),
    "shower": (0.9, 0.9, 2.1),
    "stove": (0.6, 0.6, 0.9),
    "dresser": (1.0, 0.5, 0.9),
    "nightstand": (0.5, 0.4, 0.5),
    "washing machine": (0.6, 0.6, 0.85),
}


@dataclass(frozen=True, slots=True)
class Fixture:
    """One listed instance: what it is and where."""

    label: int  # its place in the annotation, from 1
    category: str  # its corrected name, or "" if it has none
    room: int  # the place of its room in the plan


@dataclass(frozen=True, slots=True)
class Surface:
    """A painted rectangle."""

    room: int  # the place of the room in the plan that it is in
    corner: Floats  # where texel [0, 0] begins, metres `[3]`
    across: Floats  # direction of the columns, a unit vector `[3]`
    upward: Floats  # direction of the rows, a unit vector `[3]`
    texels: Texels  # labels `[rows, columns]`; `UNLISTED` and below are no instance's
    specks: Bools  # which texels are painted astray

    def box_of(self, chosen: Bools, *, texel: float) -> Box:
        """Return the box of some of its texels `[rows, columns]`, at least one."""
        rows, columns = (np.flatnonzero(chosen.any(axis=axis)) for axis in (1, 0))
        column = np.array([columns[0], columns[-1] + 1])[:, None, None]
        row = np.array([rows[0], rows[-1] + 1])[:, None]
        ends = (self.corner + texel * (column * self.across + row * self.upward)).reshape(4, 3)
        low, high = ends.min(axis=0), ends.max(axis=0)
        return Box((low[0], low[1], low[2]), (high[0], high[1], high[2]))


def furnish(
    plan: FloorPlan, fixtures: Sequence[Fixture], *, texel: float, rng: np.random.Generator
) -> list[Surface]:
    """Return the surfaces of a building, room by room.

    Args:
        plan: its rooms, doorways and stairs.
        fixtures: its instances in the order of the annotation.
        texel: side of a texel, metres.
        rng: where chance comes from.
    """
    surfaces: list[Surface] = []
    climbing = {room for stair in plan.stairs for room in stair.rooms}
    for room in range(len(plan.rooms)):
        here = [fixture for fixture in fixtures if fixture.room == room]
        surfaces += _Room(plan, room, here, texel, rng).surfaces(keep_stairs=room not in climbing)
    for stair in plan.stairs:
        listed = [f for f in fixtures if f.room in stair.rooms and f.category in STAIRS]
        label = listed[0].label if listed else UNLISTED
        surfaces += _flight(plan, stair.rooms[0], stair.rectangle, label, texel)
    return _speckle(surfaces, fixtures, texel=texel, rng=rng)


class _Room:
    """The surfaces of one room."""

    def __init__(
        self,
        plan: FloorPlan,
        room: int,
        fixtures: list[Fixture],
        texel: float,
        rng: np.random.Generator,
    ) -> None:
        self._plan, self._room, self._texel, self._rng = plan, room, texel, rng
        self._fixtures = fixtures
        self._rectangle = plan.rooms[room]
        self._floor = plan.storeys[room] * STOREY

    def surfaces(self, *, keep_stairs: bool) -> Iterator[Surface]:
        """Yield the shell of the room, painted, then its furniture."""
        floor, ceiling = self._slab(self._floor), self._slab(self._floor + HEIGHT)
        walls = self._walls()
        for category, shell in (
            (FLOOR, [floor]),
            (CEILING, [ceiling]),
            (_WALL, walls),
        ):
            _paint_strips(shell, [f.label for f in self._fixtures if f.category == category])
        rest = [f for f in self._fixtures if f.category not in (FLOOR, CEILING, _WALL)]
        doors = [f for f in rest if f.category in ("door", "door frame")]
        for fixture in rest:
            if self._rng.random() < _WITHOUT_SURFACE or fixture in doors:
                continue
            if fixture.category in STAIRS and not keep_stairs:
                continue
            if fixture.category in _ON_WALLS:
                self._hang(walls, fixture.label, width=(0.2, 1.2), height=(0.2, 1.1))
            elif fixture.category in _ON_FLOORS:
                self._hang([floor], fixture.label, width=(0.5, 1.8), height=(0.5, 1.2))
            else:
                yield from self._furniture(fixture)
        self._paint_doors(walls, doors)
        yield from (floor, ceiling, *walls)

    def _slab(self, height: float) -> Surface:
        """Return the floor, facing up, or the ceiling, facing down."""
        (x, y), (end, _) = self._rectangle.low, self._rectangle.high
        below = height == self._floor
        corner = (x if below else end, y, height)
        across = (1.0 if below else -1.0, 0.0, 0.0)
        sides = self._rectangle.sides()
        return _make(self._room, corner, across, (0.0, 1.0, 0.0), sides, self._texel)

    def _walls(self) -> list[Surface]:
        """Return the four walls, facing inwards: along x at low y, then against the clock."""
        (a, b), (c, d) = self._rectangle.low, self._rectangle.high
        z, (along, deep) = self._floor, self._rectangle.sides()
        walls = (
            ((c, b), (-1.0, 0.0), along),
            ((c, d), (0.0, -1.0), deep),
            ((a, d), (1.0, 0.0), along),
            ((a, b), (0.0, 1.0), deep),
        )
        up = (0.0, 0.0, 1.0)
        return [
            _make(self._room, (x, y, z), (*across, 0.0), up, (length, HEIGHT), self._texel)
            for (x, y), across, length in walls
        ]

    def _hang(
        self,
        surfaces: list[Surface],
        label: int,
        *,
        width: tuple[float, float],
        height: tuple[float, float],
    ) -> None:
        """Paint a rectangle somewhere on one of the surfaces."""
        surface = surfaces[int(self._rng.integers(len(surfaces)))]
        sides = []
        for length, (least, most) in zip(surface.texels.shape, (height, width), strict=True):
            size = min(length, round(self._rng.uniform(least, most) / self._texel))
            start = int(self._rng.integers(0, length - size + 1))
            sides.append(slice(start, start + size))
        surface.texels[sides[0], sides[1]] = label

    def _paint_doors(self, walls: list[Surface], fixtures: list[Fixture]) -> None:
        """Paint doors and their frames into doorways; an opening without a door is nobody's."""
        doors = [f.label for f in fixtures if f.category == "door"]
        frames = [f.label for f in fixtures if f.category != "door"]
        top, band = round(_DOOR_HEIGHT / self._texel), round(_FRAME / self._texel)
        for door in self._plan.doorways:
            if self._room in door.rooms:
                wall, start = self._place(walls, door.rooms, door.axis, door.span)
                end = start + round((door.span[1] - door.span[0]) / self._texel)
                if frames:
                    wall.texels[: top + band, max(0, start - band) : end + band] = frames.pop(0)
                wall.texels[:top, start:end] = doors.pop(0) if doors else UNLISTED - 1
        for label in (*doors, *frames):  # to the outside, or of a closet
            self._hang(self._outer(walls) or walls, label, width=(0.6, 0.9), height=(1.8, 2.0))

    def _outer(self, walls: list[Surface]) -> list[Surface]:
        """Return the walls with nothing of the building behind them."""
        rooms = self._plan.rooms
        ends = (
            min(room.low[1] for room in rooms),
            max(room.high[0] for room in rooms),
            max(room.high[1] for room in rooms),
            min(room.low[0] for room in rooms),
        )
        (a, b), (c, d) = self._rectangle.low, self._rectangle.high
        own = zip(walls, (b, c, d, a), ends, strict=True)
        return [wall for wall, here, end in own if abs(here - end) < _FRAME]

    def _place(
        self, walls: list[Surface], rooms: tuple[int, int], axis: int, span: tuple[float, float]
    ) -> tuple[Surface, int]:
        """Return the wall of a doorway and the first column of the opening."""
        other = self._plan.rooms[rooms[0] if rooms[1] == self._room else rooms[1]]
        across = 1 - axis
        before = other.low[across] < self._rectangle.low[across]
        wall = walls[(0 if before else 2) if axis == 0 else (3 if before else 1)]
        ends = [float((np.array([p, p, 0.0]) - wall.corner) @ wall.across) for p in span]
        return wall, round(min(ends) / self._texel)

    def _furniture(self, fixture: Fixture) -> list[Surface]:
        """Return a cuboid on the floor, on something, or under the ceiling."""
        usual = _SIZES.get(fixture.category)
        size = np.array(usual) * self._rng.uniform(0.85, 1.15, 3) if usual else self._small()
        low, sides = np.array(self._rectangle.low), np.array(self._rectangle.sides())
        size[:2] = np.minimum(size[:2], sides - 0.1)
        size = np.maximum(np.round(size / self._texel), 2) * self._texel
        place = low + self._rng.uniform(0.02, 0.98, 2) * (sides - size[:2])
        above = 0.0 if usual else float(self._rng.choice([0.0, 0.75, 0.9, 1.4]))
        if fixture.category in _ON_CEILINGS:
            above = HEIGHT - float(size[2])
        corner = np.round(np.array([*place, self._floor + above]) / self._texel) * self._texel
        return _cuboid(self._room, corner, size, fixture.label, self._texel)

    def _small(self) -> Floats:
        return np.clip(self._rng.lognormal(-1.6, 0.6, 3), 0.06, 1.2)


def _make(
    room: int,
    corner: npt.ArrayLike,
    across: npt.ArrayLike,
    upward: npt.ArrayLike,
    size: Sequence[float],
    texel: float,
    label: int = 0,
) -> Surface:
    """Return a surface of one label."""
    columns, rows = (max(1, round(side / texel)) for side in size)
    texels = np.full((rows, columns), label, dtype=np.int32)
    axes = np.array(corner), np.array(across), np.array(upward)
    return Surface(room, *axes, texels, np.zeros_like(texels, dtype=bool))


def _cuboid(room: int, corner: Floats, size: Floats, label: int, texel: float) -> list[Surface]:
    """Return the six faces of a cuboid, facing outwards."""
    faces = []
    for axis in range(3):
        a, b = (axis + 1) % 3, (axis + 2) % 3
        first, second, far = np.eye(3)[a], np.eye(3)[b], corner + size[axis] * np.eye(3)[axis]
        faces.append(_make(room, far, first, second, (size[a], size[b]), texel, label))
        faces.append(_make(room, corner, second, first, (size[b], size[a]), texel, label))
    return faces


def _flight(
    plan: FloorPlan, room: int, rectangle: Rectangle, label: int, texel: float
) -> list[Surface]:
    """Return stairs: blocks that rise from the floor of a room to the next storey."""
    axis = int(np.argmax(rectangle.sides()))
    steps = 8
    size = np.array([*rectangle.sides(), 0.0])
    size[axis] /= steps
    surfaces = []
    for step in range(steps):
        corner = np.array([*rectangle.low, plan.storeys[room] * STOREY])
        corner[axis] += step * size[axis]
        size[2] = STOREY * (step + 1) / steps
        edges = [np.round(place / texel) * texel for place in (corner, corner + size)]
        surfaces += _cuboid(room, edges[0], edges[1] - edges[0], label, texel)
    return surfaces


def _paint_strips(surfaces: list[Surface], labels: list[int]) -> None:
    """Share the columns of the surfaces, one after another, among instances."""
    labels = labels or [UNLISTED]
    ends = np.cumsum([surface.texels.shape[1] for surface in surfaces])
    for surface, end in zip(surfaces, ends, strict=True):
        columns = np.arange(end - surface.texels.shape[1], end)
        surface.texels[:] = np.array(labels)[columns * len(labels) // ends[-1]]


def _speckle(
    surfaces: list[Surface],
    fixtures: Sequence[Fixture],
    *,
    texel: float,
    rng: np.random.Generator,
) -> list[Surface]:
    """Paint specks of a few instances of furniture onto walls of other rooms."""
    side = max(2, round(_SPECK / texel))
    walls = [s for s in surfaces if min(s.texels.shape) > 1.5 / texel and s.upward[2] == 1.0]
    for fixture in fixtures:
        elsewhere = [wall for wall in walls if wall.room != fixture.room]
        if fixture.category not in _SIZES or not elsewhere or rng.random() >= _SPECKLED:
            continue
        wall = elsewhere[int(rng.integers(len(elsewhere)))]
        row, column = (int(rng.integers(0, length - side)) for length in wall.texels.shape)
        part = (slice(row, row + side), slice(column, column + side))
        if (wall.texels[part] != fixture.label).all() and not wall.specks[part].any():
            wall.texels[part], wall.specks[part] = fixture.label, True
    return surfaces
