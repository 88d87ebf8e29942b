"""Floor plans of synthetic buildings: rectangular rooms on storeys, with doorways and stairs.

A storey is a rectangle; one of four rooms or more has a hall along its middle and a row of rooms on
both sides of it. A doorway joins every room to the hall, or to the next room where there is none;
stairs join a storey to the next. Lengths are metres, Z up.

`draw_layout` writes the plan of a building as DomestiGraph has it, for
`bsg_data.sources.room_layouts`. It is made up: a plan knows nothing of what its rooms hold but
stairs.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass
from itertools import combinations, pairwise

import numpy as np

from bsg_data.geometry.placement import STAIRS
from bsg_data.scene.scene_graph import Box
from bsg_data.synthetic.building import SyntheticBuilding

_WALL = 0.12  # between the rooms on its two sides
_HEIGHT = 2.6  # from a floor to the ceiling above it
_STOREY = 2.9  # from a floor to the next
_DOORWAY = 0.9
_HALL = 1.5
_TO_NEIGHBOUR = 0.12  # probability of a doorway beside that to the hall
_GRID = 0.1  # every wall lies on it, and therefore on whole texels of every size


@dataclass(frozen=True, slots=True)
class _Rectangle:
    """A rectangle of a plan."""

    low: tuple[float, float]  # its lowest corner (x, y), metres
    high: tuple[float, float]  # its highest corner (x, y), metres

    def sides(self) -> tuple[float, float]:
        """Return its lengths along x and y."""
        return self.high[0] - self.low[0], self.high[1] - self.low[1]

    def shrink(self, margin: float) -> _Rectangle:
        """Return the rectangle with every side moved inwards."""
        (a, b), (c, d) = self.low, self.high
        return _Rectangle((a + margin, b + margin), (c - margin, d - margin))

    def meet(self, other: _Rectangle) -> _Rectangle:
        """Return what both cover; a side is 0 where they only touch, negative where they do not."""
        low = np.maximum(self.low, other.low)
        high = np.minimum(self.high, other.high)
        return _Rectangle((float(low[0]), float(low[1])), (float(high[0]), float(high[1])))


@dataclass(frozen=True, slots=True)
class FloorPlan:
    """The plan of a building."""

    rooms: tuple[_Rectangle, ...]  # the inner rectangle of every room
    storeys: tuple[int, ...]  # the storey of every room, from 0
    doorways: tuple[tuple[int, int], ...]  # pairs of rooms that one joins, within storeys
    stairs: tuple[tuple[int, int], ...]  # pairs of rooms that stairs join, between storeys

    def box(self, room: int) -> Box:
        """Return the box of a room, from its floor to its ceiling."""
        rectangle, floor = self.rooms[room], self.storeys[room] * _STOREY
        return Box((*rectangle.low, floor), (*rectangle.high, floor + _HEIGHT))

    def connections(self) -> list[tuple[int, int]]:
        """Return the pairs of rooms that doorways and stairs join, each ascending; sorted."""
        return sorted((min(pair), max(pair)) for pair in (*self.doorways, *self.stairs))


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
    storeys = 1
    if with_stairs and rooms > 1:
        storeys = 3 if rooms > 17 and len(with_stairs) > 1 else 2
    groups = [
        sorted(storey.tolist(), key=lambda room: (room not in hallways, room))
        for storey in np.array_split(rng.permutation(rooms), storeys)
    ]
    side = (max(map(len, groups)) + 1) // 2 * rng.uniform(3.0, 3.8)
    whole = _snap(max(side, 3.5)), _snap(rng.uniform(3.4, 4.4))  # length, depth of a row of rooms
    outer: dict[int, _Rectangle] = {}
    for group in groups:
        outer.update(zip(group, _divide(*whole, len(group), rng), strict=True))
    inner = tuple(outer[room].shrink(_WALL / 2) for room in range(rooms))
    storey_of = {room: level for level, group in enumerate(groups) for room in group}
    return FloorPlan(
        rooms=inner,
        storeys=tuple(storey_of[room] for room in range(rooms)),
        doorways=tuple(door for group in groups for door in _draw_doorways(group, outer, rng)),
        stairs=tuple(
            _choose_stairs(low, high, inner, with_stairs) for low, high in pairwise(groups)
        ),
    )


def _snap(length: float) -> float:
    return round(length / _GRID) * _GRID


def _divide(
    length: float, depth: float, rooms: int, rng: np.random.Generator
) -> Iterator[_Rectangle]:
    """Yield the rooms that fill a storey; the first of four or more is the hall."""
    far = depth + _HALL
    if rooms < 4:
        yield from _cut_row(length, (0.0, far + depth), rooms, rng)
        return
    yield _Rectangle((0.0, depth), (length, far))
    yield from _cut_row(length, (0.0, depth), (rooms - 1) // 2, rng)
    yield from _cut_row(length, (far, far + depth), rooms // 2, rng)


def _cut_row(
    length: float, across: tuple[float, float], rooms: int, rng: np.random.Generator
) -> Iterator[_Rectangle]:
    """Yield a row of rooms, from one end to the other."""
    sums = np.cumsum(rng.uniform(0.7, 1.3, rooms))
    ends = [0.0, *(_snap(end) for end in sums / sums[-1] * length)]
    for start, end in pairwise(ends):
        yield _Rectangle((start, across[0]), (end, across[1]))


def _draw_doorways(
    group: list[int], outer: dict[int, _Rectangle], rng: np.random.Generator
) -> Iterator[tuple[int, int]]:
    """Join every room of a storey to the hall, or to the next; and a few to their neighbours."""
    hall = group[0] if len(group) >= 4 else None
    for a, b in combinations(group, 2):
        sides = outer[a].meet(outer[b]).sides()
        meet = min(sides) > -1e-9 and max(sides) - _WALL - _DOORWAY > 0
        if meet and (hall is None or hall in (a, b) or rng.random() < _TO_NEIGHBOUR):
            rng.random()  # where in the wall it is, which nobody asks; the numbers after it stay
            yield a, b


def _choose_stairs(
    low: list[int], high: list[int], inner: tuple[_Rectangle, ...], wanted: Collection[int]
) -> tuple[int, int]:
    """Choose rooms of two storeys that lie above each other, where stairs are listed."""

    def merit(pair: tuple[int, int]) -> tuple[bool, bool, float]:
        least = min(inner[pair[0]].meet(inner[pair[1]]).sides())
        return least >= 1.0, pair[0] in wanted or pair[1] in wanted, least

    return max(((a, b) for a in low for b in high), key=merit)


def draw_layout(building: SyntheticBuilding, *, seed: int, number: int) -> str:
    """Return the layout of a building as YAML; equal arguments give equal text."""
    # Apart from the numbers that drew the building, so that a layout changes no annotation.
    rng = np.random.Generator(np.random.PCG64(np.random.SeedSequence((seed, number, 1))))
    regions = sorted({row.region_id for row in building.rows} - {-1})
    stairs = {row.region_id for row in building.rows if row.name in STAIRS}
    plan = draw_floor_plan(
        len(regions),
        with_stairs={room for room, region in enumerate(regions) if region in stairs},
        hallways={room for room, kind in enumerate(building.rooms) if kind == "hallway"},
        rng=rng,
    )
    lines = ["rooms:"]
    for room, kind in enumerate(building.rooms):
        lines += [f"  room_{room + 1}:", f"    label: {kind}", *_write_box(plan.box(room))]
    pairs = [f"- [{a + 1}, {b + 1}]" for a, b in plan.connections()]
    return "\n".join([*lines, "connections:" if pairs else "connections: []", *pairs, ""])


def _write_box(box: Box) -> Iterator[str]:
    """Yield the centroid and the sides of a room; of the layouts' axes, z points backwards."""
    x, y, z = box.centre
    a, b, c = (high - low for low, high in zip(box.minimum, box.maximum, strict=True))
    yield f"    centroid: {{x: {x:.2f}, y: {z:.2f}, z: {-y:.2f}}}"
    yield f"    dims: {{x: {a:.2f}, y: {c:.2f}, z: {b:.2f}}}"
