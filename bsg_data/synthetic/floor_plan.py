"""Floor plans of synthetic buildings: rectangular rooms on storeys, with doorways and stairs.

A storey is a rectangle; one of four rooms or more has a hall along its middle and columns of rooms
on both sides of it. Doorways join every room to the hall, or to a neighbour, so that all rooms of a
storey connect; stairs join a storey to the next. Lengths are metres, Z up.

`draw_layout` writes the plan of a building as DomestiGraph has it, for
`bsg_data.sources.room_layouts`. It is made up: a plan knows nothing of what its rooms hold but
stairs, and a label is a word for the latent type of a room.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from bsg_data.geometry.placement import STAIRS
from bsg_data.scene.scene_graph import Box
from bsg_data.synthetic.building import SyntheticBuilding, SyntheticRates

WALL = 0.12  # between the rooms on its two sides
HEIGHT = 2.6  # from a floor to the ceiling above it
STOREY = 2.9  # from a floor to the next
DOORWAY = 0.9
# Of the latent types of `rates.json`, by what they hold most of.
LABELS = (
    "dining room",
    "bathroom",
    "office",
    "other",
    "bedroom",
    "kitchen",
    "bedroom",
    "living room",
    "kitchen",
    "utility room",
    "bathroom",
    "living room",
    "office",
    "bedroom",
    "bedroom",
    "living room",
    "kitchen",
    "hallway",
    "bathroom",
    "closet",
)
_HALL = 1.5
_TO_HALL = 0.9  # probabilities of doorways
_TO_NEIGHBOUR = 0.12
_GRID = 0.1  # every wall lies on it, and therefore on whole texels of every size


@dataclass(frozen=True, slots=True)
class Rectangle:
    """A rectangle of a plan."""

    low: tuple[float, float]  # its lowest corner (x, y), metres
    high: tuple[float, float]  # its highest corner (x, y), metres

    def sides(self) -> tuple[float, float]:
        """Return its lengths along x and y."""
        return self.high[0] - self.low[0], self.high[1] - self.low[1]

    def grow(self, margin: float) -> Rectangle:
        """Return the rectangle with every side moved outwards."""
        (a, b), (c, d) = self.low, self.high
        return Rectangle((a - margin, b - margin), (c + margin, d + margin))

    def cut(self, axis: int, low: float, high: float) -> Rectangle:
        """Return the rectangle between two coordinates on an axis."""
        start, end = list(self.low), list(self.high)
        start[axis], end[axis] = low, high
        return Rectangle((start[0], start[1]), (end[0], end[1]))

    def meet(self, other: Rectangle) -> Rectangle:
        """Return what both cover; a side is 0 where they only touch, negative where they do not."""
        low = np.maximum(self.low, other.low)
        high = np.minimum(self.high, other.high)
        return Rectangle((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


@dataclass(frozen=True, slots=True)
class _Doorway:
    """An opening in the wall of two rooms."""

    rooms: tuple[int, int]  # indices of the two in the plan
    axis: int  # the axis that the wall runs along, 0 or 1
    span: tuple[float, float]  # where the opening starts and ends on that axis


@dataclass(frozen=True, slots=True)
class Stairs:
    """Stairs from one storey to the next."""

    rooms: tuple[int, int]  # indices in the plan of the lower and the upper room
    rectangle: Rectangle  # what they cover, inside both rooms


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """The plan of a building."""

    rooms: tuple[Rectangle, ...]  # the inner rectangle of every room
    storeys: tuple[int, ...]  # the storey of every room, from 0
    doorways: tuple[_Doorway, ...]  # within storeys
    stairs: tuple[Stairs, ...]  # between storeys

    def box(self, room: int) -> Box:
        """Return the box of a room, from its floor to its ceiling."""
        rectangle, floor = self.rooms[room], self.storeys[room] * STOREY
        return Box((*rectangle.low, floor), (*rectangle.high, floor + HEIGHT))

    def connections(self) -> list[tuple[int, int, str]]:
        """Return (room, room, `door` or `stairs`), sorted."""
        doors = [(min(door.rooms), max(door.rooms), "door") for door in self.doorways]
        stairs = [(min(flight.rooms), max(flight.rooms), "stairs") for flight in self.stairs]
        return sorted([*doors, *stairs])


def draw_floor_plan(
    rooms: int,
    *,
    with_stairs: Collection[int],
    hallways: Collection[int] = (),
    rng: np.random.Generator,
) -> FloorPlan:
    """Sample the plan of a building.

    Args:
        rooms: how many.
        with_stairs: the rooms that the annotation lists stairs in. Without any the building has
            one storey; otherwise stairs are put there if they can be.
        hallways: the rooms of which each storey takes one as its hall, if it has some.
        rng: where chance comes from.
    """
    order = [int(room) for room in rng.permutation(rooms)]
    storeys = 1
    if with_stairs and rooms > 1:
        storeys = 3 if rooms > 17 and len(with_stairs) > 1 and rng.random() < 0.4 else 2
    groups = [
        sorted(storey.tolist(), key=lambda room: (room not in hallways, room))
        for storey in np.array_split(np.array(order), storeys)
    ]
    area = max(sum(rng.lognormal(2.5, 0.25) for _ in group) for group in groups)
    width = float(np.sqrt(area * rng.uniform(1.2, 1.9)))
    whole = Rectangle((0.0, 0.0), (_snap(width), _snap(max(area / width, 3.5))))
    centres: dict[int, Rectangle] = {}
    for group in groups:
        centres.update(zip(group, _divide(whole, len(group), rng), strict=True))
    inner = tuple(centres[room].grow(-WALL / 2) for room in range(rooms))
    storey_of = {room: level for level, group in enumerate(groups) for room in group}
    doorways = [door for group in groups for door in _draw_doorways(group, centres, rng)]
    stairs = [_draw_stairs(low, high, inner, with_stairs) for low, high in pairwise(groups)]
    return FloorPlan(
        rooms=inner,
        storeys=tuple(storey_of[room] for room in range(rooms)),
        doorways=tuple(doorways),
        stairs=tuple(stairs),
    )


def _snap(length: float) -> float:
    return round(length / _GRID) * _GRID


def _divide(whole: Rectangle, rooms: int, rng: np.random.Generator) -> list[Rectangle]:
    """Divide a storey into rooms that fill it; the first of four or more is the hall."""
    if rooms < 4:
        return _columns(whole, [1] * rooms, rng)
    depth = whole.sides()[1]
    low, high = _snap((depth - _HALL) / 2), _snap((depth + _HALL) / 2)
    hall = whole.cut(1, whole.low[1] + low, whole.low[1] + high)
    near, far = (rooms - 1) // 2, (rooms - 1) - (rooms - 1) // 2
    sides = (whole.cut(1, whole.low[1], hall.low[1]), whole.cut(1, hall.high[1], whole.high[1]))
    rectangles = [hall]
    for side, count in zip(sides, (near, far), strict=True):
        deep = side.sides()[1] > 4.5
        columns: list[int] = []
        while sum(columns) < count:
            pair = deep and count - sum(columns) > 1 and rng.random() < 0.35
            columns.append(2 if pair else 1)
        rectangles += _columns(side, columns, rng)
    return rectangles


def _columns(whole: Rectangle, columns: list[int], rng: np.random.Generator) -> list[Rectangle]:
    """Cut a rectangle into columns of one room or of two, one behind the other."""
    sums = np.cumsum(rng.uniform(0.7, 1.3, len(columns)) * np.sqrt(columns))
    ends = [_snap(end) for end in sums / sums[-1] * whole.sides()[0]]
    rectangles = []
    for start, end, rooms in zip([0.0, *ends[:-1]], ends, columns, strict=True):
        column = whole.cut(0, whole.low[0] + start, whole.low[0] + end)
        middle = _snap(column.sides()[1] * rng.uniform(0.4, 0.6)) + column.low[1]
        if rooms == 1:
            rectangles.append(column)
        else:
            rectangles += [
                column.cut(1, column.low[1], middle),
                column.cut(1, middle, column.high[1]),
            ]
    return rectangles


def _draw_doorways(
    group: list[int], centres: dict[int, Rectangle], rng: np.random.Generator
) -> Iterator[_Doorway]:
    """Join the rooms of a storey: the hall's walls first, then what is still apart, then a few."""
    walls = []
    for a, b in combinations(group, 2):
        shared = centres[a].meet(centres[b])
        axis = int(np.argmax(shared.sides()))
        room = shared.sides()[axis] - WALL - DOORWAY
        if min(shared.sides()) > -1e-9 and room > 0.1:
            start = shared.low[axis] + WALL / 2 + _snap(rng.uniform(0, room - 0.05))
            walls.append(_Doorway((a, b), axis, (start, start + DOORWAY)))
    hall = group[0] if len(group) >= 4 else -1
    group_of = {room: room for room in group}
    walls = [walls[int(i)] for i in rng.permutation(len(walls))]
    for door in sorted(walls, key=lambda door: hall not in door.rooms):
        a, b = (group_of[room] for room in door.rooms)
        apart = a != b and hall not in door.rooms
        if apart or rng.random() < (_TO_HALL if hall in door.rooms else _TO_NEIGHBOUR):
            group_of = {room: a if root == b else root for room, root in group_of.items()}
            yield door
    for door in walls:  # a room whose only wall is the hall's
        a, b = (group_of[room] for room in door.rooms)
        if a != b:
            group_of = {room: a if root == b else root for room, root in group_of.items()}
            yield door


def _draw_stairs(
    low: list[int], high: list[int], inner: tuple[Rectangle, ...], wanted: Collection[int]
) -> Stairs:
    """Put stairs where the rooms of two storeys lie above each other, where they are listed."""

    def merit(pair: tuple[int, int]) -> tuple[bool, float]:
        sides = inner[pair[0]].meet(inner[pair[1]]).sides()
        return pair[0] in wanted or pair[1] in wanted, min(sides)

    pairs = [(a, b) for a in low for b in high]
    fits = [pair for pair in pairs if merit(pair)[1] >= 1.0] or pairs
    a, b = max(fits, key=merit)
    shared = inner[a].meet(inner[b])
    across, along = shared.sides()
    (x, y), long = shared.low, across >= along
    size = (min(3.0, across), 0.9) if long else (0.9, min(3.0, along))
    return Stairs((a, b), Rectangle((x, y), (x + size[0], y + size[1])))


def draw_layout(
    rates: SyntheticRates, building: SyntheticBuilding, *, seed: int, number: int
) -> str:
    """Return the layout of a building as YAML; equal arguments give equal text.

    Args:
        rates: of the building.
        building: whose rooms are laid out.
        seed: of the building.
        number: of the building.
    """
    # Apart from the numbers that drew the building, so that a layout changes no annotation.
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number, 1))))
    labels = [LABELS[kind] for _, kind in building.room_types]
    plan = draw_floor_plan(
        len(labels),
        with_stairs=_list_stairs(rates, building),
        hallways={room for room, label in enumerate(labels) if label == "hallway"},
        rng=rng,
    )
    lines = ["rooms:"]
    for room, label in enumerate(labels):
        lines += [f"  room_{room + 1}:", f"    label: {label}", *_write_box(plan, room)]
    pairs = [f"- [{a + 1}, {b + 1}]" for a, b, _ in plan.connections()]
    return "\n".join([*lines, "connections:" if pairs else "connections: []", *pairs, ""])


def _list_stairs(rates: SyntheticRates, building: SyntheticBuilding) -> set[int]:
    """Return the indices of the rooms in which the annotation lists stairs."""
    spelt = zip(rates.categories, rates.spellings, strict=True)
    names = {raw for category, raws in spelt if category in STAIRS for raw, _ in raws}
    regions = {row.region_id for row in building.rows if row.name in names}
    return {room for room, (region, _) in enumerate(building.room_types) if region in regions}


def _write_box(plan: FloorPlan, room: int) -> list[str]:
    """Return the centroid and the sides of a room; of the layouts' axes, z points backwards."""
    box = plan.box(room)
    x, y, z = box.centre
    a, b, c = (high - low for low, high in zip(box.minimum, box.maximum, strict=True))
    return [
        f"    centroid: {{x: {x:.2f}, y: {z:.2f}, z: {-y:.2f}}}",
        f"    dims: {{x: {a:.2f}, y: {c:.2f}, z: {b:.2f}}}",
    ]
