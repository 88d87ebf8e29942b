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
from dataclasses import dataclass, field
from pathlib import Path

from bsg_data.errors import AnnotationError
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.sources.annotation_files import malformed

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
    """One region."""

    level: int  # index of its level; `NOWHERE` without one
    label: str  # its letter, `k` for a kitchen; `-` without one
    box: Box | None  # around it, metres; None for an empty region
    # of its floor, corners (x, y) as the file orders them; metres
    polygons: tuple[tuple[tuple[float, float], ...], ...]


@dataclass(frozen=True, slots=True)
class House:
    """What a `.house` file says of one building."""

    # height of the lowest point of each, by its index, metres; None for an empty one
    levels: tuple[float | None, ...]
    regions: tuple[HouseRegion, ...]  # by their index
    # pairs of regions that an opening joins, ascending and once each
    portals: tuple[tuple[int, int], ...]
    categories: tuple[str, ...]  # names as annotators wrote them, by their index
    # region, category and axis-aligned box of each, by its index; `NOWHERE` without a region or a
    # category, None without a box
    objects: tuple[tuple[int, int, Box | None], ...]


def parse_house(text: str, *, path: Path) -> House:
    """Parse a `.house` file."""
    lines = text.split("\n")
    if lines[0].strip() != HEADER:
        raise malformed(path, 1, lines[0], expected=repr(HEADER))
    reading = _Reading()
    for number, line in enumerate(lines[1:], start=2):
        fields = line.split()
        if fields:
            reading.add(_Line(path, number, line, fields))
    if reading.header is None:
        raise malformed(path, 2, "", expected="a header, a line of H")
    return reading.finish(reading.header)


@dataclass(frozen=True, slots=True)
class _Line:
    """One line in fields, which complains with its place in the file."""

    path: Path
    number: int
    text: str
    fields: list[str]

    @property
    def kind(self) -> str:
        letter = self.fields[0]
        if letter in ("P", "R") and len(self.fields) == _PORTAL_FIELDS and self.fields[4] != "0":
            return "portal"
        return "panorama" if letter == "P" else letter

    def fault(self, expected: str) -> AnnotationError:
        return malformed(self.path, self.number, self.text, expected=expected)

    def field(self, place: int, what: str) -> str:
        if place >= len(self.fields):
            raise self.fault(f"{what} as field {place + 1} of {self.fields[0]}")
        return self.fields[place]

    def whole(self, place: int, what: str) -> int:
        word = self.field(place, what)
        if not _WHOLE.fullmatch(word):
            raise self.fault(f"{what}, a whole number, as field {place + 1} of {self.fields[0]}")
        return int(word)

    def refer(self, place: int, what: str, among: int) -> int:
        index = self.whole(place, what)
        if not NOWHERE <= index < among:
            raise self.fault(f"{what} that an earlier line has (0..{among - 1}), or {NOWHERE}")
        return index

    def point(self, place: int, what: str) -> Point:
        try:
            x, y, z = (float(self.field(at, what)) for at in range(place, place + 3))
        except ValueError:
            x = y = z = math.nan
        if not all(abs(value) <= MAX_METRES for value in (x, y, z)):  # nan is not
            raise self.fault(f"{what}, 3 numbers of metres from field {place + 1} on")
        return x, y, z

    def box(self, place: int) -> Box | None:
        """Return a box; None for an empty one, which is written inside out, perhaps by 1e20."""
        ends = [self.field(at, "a box") for at in range(place, place + 6)]
        try:
            if all(float(a) > float(b) for a, b in zip(ends[:3], ends[3:], strict=True)):
                return None
        except ValueError:
            pass  # `point` says it
        low, high = self.point(place, "a box"), self.point(place + 3, "a box")
        if any(a > b for a, b in zip(low, high, strict=True)):
            raise self.fault("a box whose lowest corner is not above its highest")
        return Box(low, high)

    def oriented_box(self) -> Box | None:
        """Return the axis-aligned box around the oriented one of an object; None for an empty one.

        Its two axes are unit vectors, and the third is their cross product; an empty one has radii
        below 0.
        """
        centre = self.point(4, "a centre")
        a, b = self.point(7, "an axis"), self.point(10, "an axis")
        radii = self.point(13, "radii")
        if min(radii) < 0:
            return None
        if max(math.hypot(*a), math.hypot(*b)) > _LONGEST_AXIS:
            raise self.fault("axes of length 1")
        c = (a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0])
        reach = [
            sum(abs(e[i]) * r for e, r in zip((a, b, c), radii, strict=True)) for i in range(3)
        ]
        x, y, z = ((centre[i] - reach[i], centre[i] + reach[i]) for i in range(3))
        return Box((x[0], y[0], z[0]), (x[1], y[1], z[1]))


@dataclass(slots=True)
class _Reading:
    """What was read so far."""

    counted: Counter[str] = field(default_factory=Counter)
    header: _Line | None = None
    levels: list[float | None] = field(default_factory=list)
    regions: list[tuple[int, str, Box | None]] = field(default_factory=list)
    surfaces: list[tuple[int, list[tuple[float, float]]]] = field(default_factory=list)
    portals: set[tuple[int, int]] = field(default_factory=set)
    categories: list[str] = field(default_factory=list)
    objects: list[tuple[int, int, Box | None]] = field(default_factory=list)

    def add(self, line: _Line) -> None:
        kind = line.kind
        if kind in ("L", "R", "S", "C", "O") and line.whole(1, "its index") != self.counted[kind]:
            raise line.fault(f"the next index, {self.counted[kind]}")
        if kind == "H":
            if self.header is not None:
                raise line.fault("one header H")
            self.header = line
        elif kind == "L":
            box = line.box(7)
            self.levels.append(None if box is None else box.minimum[2])
        elif kind == "R":
            level = line.refer(2, "a level", len(self.levels))
            self.regions.append((level, line.field(5, "a label"), line.box(9)))
        elif kind == "portal":
            one, other = (line.refer(at, "a region", len(self.regions)) for at in (2, 3))
            if one != other and NOWHERE not in (one, other):
                self.portals.add((min(one, other), max(one, other)))
        elif kind == "S":
            self.surfaces.append((line.refer(2, "a region", len(self.regions)), []))
        elif kind == "V":
            surface = line.refer(2, "a surface", len(self.surfaces))
            if surface != NOWHERE:
                self.surfaces[surface][1].append(line.point(4, "a position")[:2])
        elif kind == "C":
            self.categories.append(line.field(3, "a name").replace("#", " "))
        elif kind == "O":
            region = line.refer(2, "a region", len(self.regions))
            category = line.refer(3, "a category", len(self.categories))
            self.objects.append((region, category, line.oriented_box()))
        elif kind not in _COUNTED:
            raise line.fault("a line of H, L, R, P, S, V, I, C, O or E")
        self.counted[kind] += 1

    def finish(self, header: _Line) -> House:
        for place, kind in enumerate(_COUNTED, start=3):
            if header.whole(place, "a count") != self.counted[kind]:
                raise header.fault(
                    f"{self.counted[kind]} lines of {kind} as field {place + 1} of H"
                )
        regions = [
            HouseRegion(
                *region, tuple(tuple(v) for r, v in self.surfaces if r == place and len(v) > 2)
            )
            for place, region in enumerate(self.regions)
        ]
        return House(
            levels=tuple(self.levels),
            regions=tuple(regions),
            portals=tuple(sorted(self.portals)),
            categories=tuple(self.categories),
            objects=tuple(self.objects),
        )
