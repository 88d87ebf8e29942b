"""Place the rooms of a building, seen from above, on a page: one storey beside another."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import chain

from bsg_data.scene.scene_graph import Point, Room
from bsg_models.belief.partial_graph import KnownRoom

Spot = tuple[float, float]
Outline = tuple[Spot, ...]
HALF = 1.2  # metres: half a side of the square for a room whose position alone is known
_GAP = 0.6  # metres between storeys
_CAPTION = 0.9  # metres above a storey if there are several
_LETTERS = 0.3  # metres from the top of a room to its name, roughly
_DIGITS = 2
_APART = 0.4  # metres from a piece of furniture to what is expected on it


@dataclass(frozen=True, slots=True)
class KnownOutline:
    """The known outline of a room, from above."""

    number: int  # of the room, 1..R
    name: str
    outline: Outline | None  # corners in metres, y up
    floor_index: int | None  # storey, 0 at the bottom; None is drawn as the lowest


@dataclass(frozen=True, slots=True)
class PlannedRoom:
    """A room on a plan."""

    number: int  # of the room, 1..R
    name: str  # unique on the plan
    outline: Outline  # corners, metres
    part: int  # storey on which it is drawn, counted from 0
    name_x: float  # where its name may begin: left, or beside a room that covers that corner

    @property
    def left(self) -> float:
        """Least x."""
        return min(x for x, _ in self.outline)

    @property
    def right(self) -> float:
        """Greatest x."""
        return max(x for x, _ in self.outline)

    @property
    def top(self) -> float:
        """Least y."""
        return min(y for _, y in self.outline)

    @property
    def bottom(self) -> float:
        """Greatest y."""
        return max(y for _, y in self.outline)


@dataclass(frozen=True, slots=True)
class Plan:
    """Positions of rooms on a page, in metres from 0: x to the right, y down."""

    rooms: tuple[PlannedRoom, ...]  # large ones first, so that small ones are drawn over them
    captions: tuple[tuple[str, Spot], ...]  # names of storeys and where they begin, if several
    width: float
    height: float


def outline_room(room: Room | KnownRoom, position: Point | None) -> Outline | None:
    """Return a room from above: its footprint, else its box, else a square at its position."""
    if room.footprint is not None:
        return tuple(_round(x, y) for x, y in room.footprint)
    if room.box is not None:
        (a, b, _), (c, d, _) = room.box.minimum, room.box.maximum
    elif position is not None:
        x, y, _ = position
        a, b, c, d = x - HALF, y - HALF, x + HALF, y + HALF
    else:
        return None
    return tuple(_round(x, y) for x, y in _square(a, b, c, d))


def draw_plan(rooms: Sequence[KnownOutline], *, aspect: float = 1.3) -> Plan:
    """Place rooms on a page of about the given width / height, the highest storey first.

    Rooms without an outline become squares of one size, apart from the others. Rooms that share a
    name are numbered.
    """
    storeys: dict[int, list[KnownOutline]] = {}
    for room in sorted(rooms, key=lambda room: -(room.floor_index or 0)):
        if room.outline is not None:
            storeys.setdefault(room.floor_index or 0, []).append(room)
    blocks = [_turn(f"storey {floor}", of_storey) for floor, of_storey in storeys.items()]
    loose = [room.number for room in rooms if room.outline is None]
    if loose:
        blocks.append(_line_up("somewhere", loose, aspect))
    alike = number_alike([room.name for room in rooms])
    names = {room.number: name for room, name in zip(rooms, alike, strict=True)}
    return _pack(blocks, names, aspect)


def number_alike(names: Sequence[str]) -> tuple[str, ...]:
    """Number names that occur more than once, so that each is unique.

    >>> number_alike(["bedroom", "hall", "bedroom"])
    ('bedroom 1', 'hall', 'bedroom 2')
    """
    often, seen = Counter(names), Counter[str]()
    numbered = []
    for name in names:
        seen[name] += 1
        numbered.append(name if often[name] == 1 else f"{name} {seen[name]}")
    return tuple(numbered)


@dataclass(frozen=True, slots=True)
class _Block:
    """Rooms that lie together, by number, from (0, 0)."""

    title: str
    outlines: dict[int, Outline]
    width: float
    height: float


def _turn(title: str, rooms: Sequence[KnownOutline]) -> _Block:
    """Return rooms of one storey with y down and their common corner at (0, 0)."""
    outlines = {room.number: room.outline or () for room in rooms}
    xs, ys = zip(*chain.from_iterable(outlines.values()), strict=True)
    left, top = min(xs), max(ys)
    turned = {n: tuple((x - left, top - y) for x, y in out) for n, out in outlines.items()}
    return _Block(title, turned, max(xs) - left, top - min(ys))


def _line_up(title: str, numbers: Sequence[int], aspect: float) -> _Block:
    """Return rooms without a known position as squares in rows."""
    across = max(1, math.ceil(math.sqrt(len(numbers) * aspect)))
    side, pitch = 2 * HALF, 2 * HALF + _GAP
    outlines = {}
    for k, number in enumerate(numbers):
        x, y = (k % across) * pitch, (k // across) * pitch
        outlines[number] = _square(x, y, x + side, y + side)
    rows = -(-len(numbers) // across)
    return _Block(title, outlines, min(across, len(numbers)) * pitch - _GAP, rows * pitch - _GAP)


def _pack(blocks: Sequence[_Block], names: Mapping[int, str], aspect: float) -> Plan:
    """Arrange blocks in the number of columns that shows them largest on a page."""
    head = _CAPTION if len(blocks) > 1 else 0.0
    sizes = {}
    for columns in range(1, len(blocks) + 1):
        widths, heights = _grid(blocks, columns, head)
        sizes[columns] = max(sum(widths), aspect * sum(heights))
    columns = min(sizes, key=sizes.__getitem__, default=1)
    widths, heights = _grid(blocks, columns, head)
    rooms, captions = [], []
    for part, block in enumerate(blocks):
        x, y = sum(widths[: part % columns]), sum(heights[: part // columns])
        if head:
            captions.append((block.title, _round(x, y + 0.7 * head)))
        for number, outline in block.outlines.items():
            moved = tuple(_round(x + a, y + head + b) for a, b in outline)
            rooms.append(PlannedRoom(number, names[number], moved, part, min(moved)[0]))
    rooms.sort(key=lambda room: (room.left - room.right) * (room.bottom - room.top))
    placed = [replace(room, name_x=_find_name(room, rooms[k:])) for k, room in enumerate(rooms, 1)]
    width, height = _round(max(sum(widths) - _GAP, 0.0), max(sum(heights) - _GAP, 0.0))
    return Plan(tuple(placed), tuple(captions), width, height)


def _find_name(room: PlannedRoom, over: Sequence[PlannedRoom]) -> float:
    """Return the x where a name may begin at the top of a room, clear of rooms drawn over it."""
    x, y = room.left, room.top + _LETTERS
    for other in sorted(over, key=lambda other: other.left):
        if other.left <= x < other.right and other.top < y < other.bottom:
            x = other.right
    return x if x < room.right else room.left


def _grid(blocks: Sequence[_Block], columns: int, head: float) -> tuple[list[float], list[float]]:
    """Return the widths of the columns and the heights of the rows, including gaps."""
    widths = [
        max((b.width for b in blocks[k::columns]), default=0.0) + _GAP for k in range(columns)
    ]
    rows = range(0, len(blocks), columns)
    heights = [max(b.height for b in blocks[k : k + columns]) + head + _GAP for k in rows]
    return widths, heights


def _round(x: float, y: float) -> Spot:
    return round(x, _DIGITS), round(y, _DIGITS)


def _square(a: float, b: float, c: float, d: float) -> Outline:
    return (a, b), (c, b), (c, d), (a, d)


def place_beside(place: Point | None, number: int) -> list[float] | None:
    """Return a place around a piece of furniture, another one for each number; None without it."""
    if place is None:
        return None
    angle = number * math.pi * (3 - math.sqrt(5))  # the golden angle: neighbours are far apart
    x, y, z = place
    return [round(x + _APART * math.cos(angle), 2), round(y + _APART * math.sin(angle), 2), z]
