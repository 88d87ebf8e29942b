"""Matterport3D's `.house` text: levels, regions with their floor polygons, categories, objects.

The first line is `ASCII 1.1`; every other begins with a letter that says what it is (niessner/
Matterport, data_organization.md): H counts the others, L levels, R regions, P panoramas, S
surfaces, V the vertices of their polygons, C categories, O objects. I images and E segments are
counted and not read. A portal is a P by the description and an R by the program that writes the
files; its 15 fields tell it from both. Indices run from 0 and refer to earlier lines. Metres; z
points up.
"""

from __future__ import annotations

import math
import re
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from bsg_data.errors import AnnotationError
from bsg_data.scene.scene_graph import Box, Point

HEADER = "ASCII 1.1"
MAX_METRES = 10_000.0
NOWHERE = -1  # the index of no level, no region or no category
_WHOLE = re.compile(r"-?[0-9]{1,9}")
_PORTAL_FIELDS = 15  # with its label as the fifth; a panorama has 13, a region 20 with a 0 there
_LONGEST_AXIS = 1.01  # of a unit vector that was rounded
# What H counts, in its order, and the letter of the lines that it counts; E is named #segments.
_COUNTED = ("I", "panorama", "V", "S", "E", "O", "C", "R", "portal", "L")


@dataclass(frozen=True, slots=True)
class HouseRegion:
    """One region.

    Attributes:
        level: index of its level; `NOWHERE` without one.
        label: its letter, `k` for a kitchen; `-` without one.
        box: around it, metres; None for an empty region.
        polygons: of its floor, corners (x, y) as the file orders them; metres.
    """

    level: int
    label: str
    box: Box | None
    polygons: tuple[tuple[tuple[float, float], ...], ...]


@dataclass(frozen=True, slots=True)
class HouseCategory:
    """One category of objects.

    Attributes:
        name: as annotators wrote it, with spaces.
        mpcat40: the name of its group of 40; empty without one.
    """

    name: str
    mpcat40: str


@dataclass(frozen=True, slots=True)
class HouseObject:
    """One object.

    Attributes:
        index: its own.
        region: index of its region; `NOWHERE` without one.
        category: index of its category; `NOWHERE` without one.
        box: axis-aligned, around the oriented one, metres; None for an empty one.
    """

    index: int
    region: int
    category: int
    box: Box | None


@dataclass(frozen=True, slots=True)
class House:
    """What a `.house` file says of one building.

    Attributes:
        levels: height of the lowest point of each, by its index, metres; None for an empty one.
        regions: by their index.
        portals: pairs of regions that an opening joins, ascending and once each.
        categories: by their index.
        objects: in the order of their indices.
    """

    levels: tuple[float | None, ...]
    regions: tuple[HouseRegion, ...]
    portals: tuple[tuple[int, int], ...]
    categories: tuple[HouseCategory, ...]
    objects: tuple[HouseObject, ...]


def parse_house(text: str, *, path: Path) -> House:
    """Parse a `.house` file.

    Args:
        text: of the file.
        path: named in errors.

    Raises:
        AnnotationError: for the first malformed line, an index that is not the next one, a
            reference to a line that is not there, a number that is not finite, or counts of the
            header that are not those of the lines.
    """
    lines = text.split("\n")
    if lines[0].strip() != HEADER:
        raise AnnotationError(path, 1, lines[0], expected=repr(HEADER))
    reading = _Reading(path)
    for number, line in enumerate(lines[1:], start=2):
        fields = line.split()
        if fields:
            reading.add(_Line(path, number, line, fields))
    return reading.finish()


@dataclass(frozen=True, slots=True)
class _Line:
    """One line in fields, which complains with its place in the file."""

    path: Path
    number: int
    text: str
    fields: list[str]

    def fault(self, expected: str) -> AnnotationError:
        return AnnotationError(self.path, self.number, self.text, expected=expected)

    def field(self, place: int, what: str) -> str:
        if place >= len(self.fields):
            raise self.fault(f"{what} as field {place + 1} of {self.fields[0]}")
        return self.fields[place]

    def whole(self, place: int, what: str) -> int:
        if not _WHOLE.fullmatch(self.field(place, what)):
            raise self.fault(f"{what}, a whole number, as field {place + 1} of {self.fields[0]}")
        return int(self.fields[place])

    def own_index(self, among: int) -> None:
        if self.whole(1, "its index") != among:
            raise self.fault(f"the next index, {among}")

    def refer(self, place: int, what: str, among: int) -> int:
        index = self.whole(place, what)
        if not NOWHERE <= index < among:
            raise self.fault(f"{what} that an earlier line has (0..{among - 1}), or {NOWHERE}")
        return index

    def numbers(self, place: int, what: str, count: int) -> tuple[float, ...]:
        values = tuple(_number(self.field(at, what)) for at in range(place, place + count))
        if not all(abs(value) <= MAX_METRES for value in values):  # nan is not
            raise self.fault(f"{what}, {count} numbers of metres from field {place + 1} on")
        return values

    def point(self, place: int, what: str) -> Point:
        x, y, z = self.numbers(place, what, 3)
        return x, y, z

    def box(self, place: int) -> Box | None:
        """Return a box; None for an empty one, which is written inside out."""
        ends = [_number(self.field(at, "a box")) for at in range(place, place + 6)]
        if all(low > high for low, high in zip(ends[:3], ends[3:], strict=True)):
            return None
        low, high = self.point(place, "a box"), self.point(place + 3, "a box")
        if any(a > b for a, b in zip(low, high, strict=True)):
            raise self.fault("a box whose lowest corner is not above its highest")
        return Box(low, high)


@dataclass(slots=True)
class _Reading:
    """What was read so far."""

    path: Path
    counted: Counter[str] = field(default_factory=Counter)
    header: _Line | None = None
    levels: list[float | None] = field(default_factory=list)
    regions: list[tuple[int, str, Box | None]] = field(default_factory=list)
    surfaces: list[tuple[int, list[tuple[float, float]]]] = field(default_factory=list)
    portals: set[tuple[int, int]] = field(default_factory=set)
    categories: list[HouseCategory] = field(default_factory=list)
    objects: list[HouseObject] = field(default_factory=list)

    def add(self, line: _Line) -> None:
        kind = line.fields[0]
        if kind in ("P", "R") and len(line.fields) == _PORTAL_FIELDS and line.fields[4] != "0":
            kind = "portal"
        elif kind == "P":
            kind = "panorama"
        read = _READERS.get(kind)
        if read is not None:
            read(self, line)
        elif kind not in _COUNTED:
            raise line.fault("a line of H, L, R, P, S, V, I, C, O or E")
        self.counted[kind] += 1

    def read_header(self, line: _Line) -> None:
        if self.header is not None:
            raise line.fault("one header H")
        self.header = line

    def read_level(self, line: _Line) -> None:
        line.own_index(len(self.levels))
        box = line.box(7)
        self.levels.append(None if box is None else box.minimum[2])

    def read_region(self, line: _Line) -> None:
        line.own_index(len(self.regions))
        level = line.refer(2, "a level", len(self.levels))
        self.regions.append((level, line.field(5, "a label"), line.box(9)))

    def read_portal(self, line: _Line) -> None:
        one, other = (line.refer(place, "a region", len(self.regions)) for place in (2, 3))
        if one != other and NOWHERE not in (one, other):
            self.portals.add((min(one, other), max(one, other)))

    def read_surface(self, line: _Line) -> None:
        line.own_index(len(self.surfaces))
        self.surfaces.append((line.refer(2, "a region", len(self.regions)), []))

    def read_vertex(self, line: _Line) -> None:
        surface = line.refer(2, "a surface", len(self.surfaces))
        x, y, _ = line.point(4, "a position")
        if surface != NOWHERE:
            self.surfaces[surface][1].append((x, y))

    def read_category(self, line: _Line) -> None:
        line.own_index(len(self.categories))
        name = line.field(3, "a name").replace("#", " ")
        self.categories.append(HouseCategory(name, " ".join(line.fields[5:6])))

    def read_object(self, line: _Line) -> None:
        line.own_index(len(self.objects))
        self.objects.append(
            HouseObject(
                index=len(self.objects),
                region=line.refer(2, "a region", len(self.regions)),
                category=line.refer(3, "a category", len(self.categories)),
                box=_surround(line),
            )
        )

    def finish(self) -> House:
        if self.header is None:
            raise AnnotationError(self.path, None, "", expected="a header, a line of H")
        for place, kind in enumerate(_COUNTED, start=3):
            stated = self.header.whole(place, "a count")
            if stated != self.counted[kind]:
                what = f"{kind}s" if len(kind) > 1 else f"lines of {kind}"
                raise self.header.fault(
                    f"{self.counted[kind]} as field {place + 1} of H, the number of {what}"
                )
        return House(
            levels=tuple(self.levels),
            regions=tuple(
                HouseRegion(
                    *region, tuple(tuple(v) for r, v in self.surfaces if r == place and len(v) > 2)
                )
                for place, region in enumerate(self.regions)
            ),
            portals=tuple(sorted(self.portals)),
            categories=tuple(self.categories),
            objects=tuple(self.objects),
        )


_READERS: dict[str, Callable[[_Reading, _Line], None]] = {
    "H": _Reading.read_header,
    "L": _Reading.read_level,
    "R": _Reading.read_region,
    "portal": _Reading.read_portal,
    "S": _Reading.read_surface,
    "V": _Reading.read_vertex,
    "C": _Reading.read_category,
    "O": _Reading.read_object,
}


def _number(text: str) -> float:
    """Return a number; nan for what is none."""
    try:
        return float(text)
    except ValueError:
        return math.nan


def _surround(line: _Line) -> Box | None:
    """Return the axis-aligned box around the oriented box of an object; None for an empty one.

    Its two axes are unit vectors, and the third is their cross product; an empty one has radii
    below 0.
    """
    centre = line.point(4, "a centre")
    a, b = line.point(7, "an axis"), line.point(10, "an axis")
    radii = line.point(13, "radii")
    if min(radii) < 0:
        return None
    if max(math.hypot(*a), math.hypot(*b)) > _LONGEST_AXIS:
        raise line.fault("axes of length 1")
    c = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
    reach = [abs(a[i]) * radii[0] + abs(b[i]) * radii[1] + abs(c[i]) * radii[2] for i in range(3)]
    x, y, z = ((centre[i] - reach[i], centre[i] + reach[i]) for i in range(3))
    return Box((x[0], y[0], z[0]), (x[1], y[1], z[1]))
