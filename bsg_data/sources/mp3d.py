"""Matterport3D's houses: `.house` text with levels, labelled rooms and their polygons, objects.

The first line is `ASCII 1.1`; every other begins with a letter that says what it is (niessner/
Matterport, data_organization.md): H counts the others, L levels, R regions, P panoramas, S
surfaces, V the vertices of their polygons, C categories, O objects. I images and E segments are
counted and not read. A portal is a P by the description and an R by the program that writes the
files; its 15 fields tell it from both. Indices run from 0 and refer to earlier lines. Metres; z
points up.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import ClassVar

import numpy as np

from bsg_data.errors import AnnotationError
from bsg_data.geometry.adjacency import connect_rooms
from bsg_data.geometry.placement import find_storeys, measure_area, surround
from bsg_data.inputs.bounds import HOUSE
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import Box, Point, Room, SceneObject
from bsg_data.sources.annotation_files import decode, find_files, malformed, read_listed
from bsg_data.sources.assembly import assemble, connect, place_room
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SourceRow, Terms

# The letters of regions, in the words of the format's description.
REGION_LABELS = {
    "a": "bathroom",
    "b": "bedroom",
    "c": "closet",
    "d": "dining room",
    "e": "entryway/foyer/lobby",
    "f": "familyroom",
    "g": "garage",
    "h": "hallway",
    "i": "library",
    "j": "laundryroom/mudroom",
    "k": "kitchen",
    "l": "living room",
    "m": "meetingroom/conferenceroom",
    "n": "lounge",
    "o": "office",
    "p": "porch/terrace/deck/driveway",
    "r": "rec/game",
    "s": "stairs",
    "t": "toilet",
    "u": "utilityroom/toolroom",
    "v": "tv",
    "w": "workout/gym/exercise",
    "x": "outdoor",
    "y": "balcony",
    "z": "other room",
    "B": "bar",
    "C": "classroom",
    "D": "dining booth",
    "S": "spa/sauna",
    "Z": "junk",
}
_HEADER = "ASCII 1.1"
_MAX_METRES = 10_000.0
_NOWHERE = -1  # the index of no level, no region or no category
_UNNAMED = "-"  # the name of a category that has none
_JUNK = "Z"  # reflections in mirrors and points that float in space: no room
_WHOLE = re.compile(r"-?[0-9]{1,9}")
_PORTAL_FIELDS = 15  # with its label as the fifth; a panorama has 13, a region 20 with a 0 there
_LONGEST_AXIS = 1.01  # of a unit vector that was rounded
# What H counts, in its order, and the letter of the lines that it counts; E is named #segments.
_COUNTED = ("I", "panorama", "V", "S", "E", "O", "C", "R", "portal", "L")


@dataclass(frozen=True)
class MatterportHouses:
    """A folder with `.house` files anywhere below it, packed or not, or one such file."""

    path: Path

    kind = "mp3d"
    options: ClassVar[dict[str, int | str]] = {}

    def find(self) -> FoundScenes:
        """Find every `<house>.house` and `<house>.house.gz`."""
        expected = (
            "no house found; expected files named <house>.house or <house>.house.gz, which "
            "Matterport3D has in its house_segmentations"
        )
        return find_files(self.path, ".house", bound=HOUSE, expected=expected)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one house; what no portal joins is left to the boxes of rooms and doors.

        Regions of junk are no rooms, and their objects belong to the building.
        """
        path = self.path if self.path.is_file() else self.path / ref.location
        data = read_listed(path, HOUSE, expected=ref.fingerprint)
        house = parse_house(decode(data, path=path), path=path)
        rooms = [_room(r, n) for n, r in enumerate(house.regions) if r.label != _JUNK]
        graph = assemble(
            _list_objects(house),
            ref=ref,
            kind=self.kind,
            sha256=hashlib.sha256(data).hexdigest(),
            class_map=class_map,
            rooms=_set_levels(find_storeys(rooms), house),
        )
        index = {room.region_id: room.room_index for room in graph.rooms}
        doors = [(index[a], index[b]) for a, b in house.portals if a in index and b in index]
        return Reading(connect(connect_rooms(graph), doors, method="door"))


@dataclass(slots=True)
class _Region:
    level: int  # index of its level; `_NOWHERE` without one
    label: str  # its letter, `k` for a kitchen; `-` without one
    box: Box | None  # around it, metres; None for an empty region
    # of its floor, corners (x, y) as the file orders them; metres; less than three are none
    polygons: list[list[tuple[float, float]]] = field(default_factory=list)


@dataclass(slots=True)
class House:
    """What the lines of a `.house` file said so far; all in the order of their indices."""

    counted: Counter[str] = field(default_factory=Counter)  # lines by their kinds
    header: _Line | None = None
    levels: list[float | None] = field(default_factory=list)  # lowest z; None for an empty one
    regions: list[_Region] = field(default_factory=list)
    surfaces: list[list[tuple[float, float]]] = field(default_factory=list)  # polygons of regions
    portals: set[tuple[int, int]] = field(default_factory=set)  # of two regions, ascending
    categories: list[str] = field(default_factory=list)
    # region, category and axis-aligned box; `_NOWHERE` without the first two, None without a box
    objects: list[tuple[int, int, Box | None]] = field(default_factory=list)

    def add(self, line: _Line) -> None:
        """Take up one line, which may refer to earlier ones alone."""
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
            self.regions.append(_Region(level, line.field(5, "a label"), line.box(9)))
        elif kind == "portal":
            one, other = sorted(line.refer(at, "a region", len(self.regions)) for at in (2, 3))
            if one != other and one != _NOWHERE:
                self.portals.add((one, other))
        elif kind == "S":
            region = line.refer(2, "a region", len(self.regions))
            self.surfaces.append([])
            if region != _NOWHERE:
                self.regions[region].polygons.append(self.surfaces[-1])
        elif kind == "V":
            surface = line.refer(2, "a surface", len(self.surfaces))
            if surface != _NOWHERE:
                self.surfaces[surface].append(line.point(4, "a position")[:2])
        elif kind == "C":
            self.categories.append(line.field(3, "a name").replace("#", " "))
        elif kind == "O":
            region = line.refer(2, "a region", len(self.regions))
            category = line.refer(3, "a category", len(self.categories))
            self.objects.append((region, category, line.oriented_box()))
        elif kind not in _COUNTED:
            raise line.fault("a line of H, L, R, P, S, V, I, C, O or E")
        self.counted[kind] += 1


def parse_house(text: str, *, path: Path) -> House:
    """Parse a `.house` file; the error names the first malformed line."""
    lines = text.split("\n")
    if lines[0].strip() != _HEADER:
        raise malformed(path, 1, lines[0], expected=repr(_HEADER))
    house = House()
    for number, line in enumerate(lines[1:], start=2):
        if fields := line.split():
            house.add(_Line(path, number, line, fields))
    header = house.header
    if header is None:
        raise malformed(path, 2, "", expected="a header, a line of H")
    for place, kind in enumerate(_COUNTED, start=3):
        count = house.counted[kind]
        if header.whole(place, "a count") != count:
            raise header.fault(f"{count} lines of {kind} as field {place + 1} of H")
    return house


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
        if not _NOWHERE <= index < among:
            raise self.fault(f"{what} that an earlier line has (0..{among - 1}), or {_NOWHERE}")
        return index

    def point(self, place: int, what: str) -> Point:
        try:
            x, y, z = (float(self.field(at, what)) for at in range(place, place + 3))
        except ValueError:
            x = y = z = math.nan
        if not all(abs(value) <= _MAX_METRES for value in (x, y, z)):  # nan is not
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
        x, y, z = (
            sum(abs(e[i]) * r for e, r in zip((a, b, c), radii, strict=True)) for i in range(3)
        )
        cx, cy, cz = centre
        return Box((cx - x, cy - y, cz - z), (cx + x, cy + y, cz + z))


def _list_objects(house: House) -> Iterator[SceneObject]:
    for number, (region, category, box) in enumerate(house.objects):
        name = "" if category == _NOWHERE else house.categories[category]
        is_placed = region != _NOWHERE and house.regions[region].label != _JUNK
        yield SceneObject(
            object_index=0,
            instance_id=number,
            room_index=region if is_placed else _NOWHERE,
            raw_category="" if name == _UNNAMED else name,
            centroid=None if box is None else box.centre,
            box=box,
            part_box=box,
        )


def _room(held: _Region, region: int) -> Room:
    """Return a room with the box and the footprint of its region, if that has any."""
    polygons = [polygon for polygon in held.polygons if len(polygon) > 2]
    room = Room(
        room_index=0,
        region_id=region,
        source_label=REGION_LABELS.get(held.label),
        label=label_of("mp3d", held.label),
        floor_area=sum(measure_area(polygon) or 0.0 for polygon in polygons) or None,
    )
    if held.box is None:
        return room
    corners = [corner for polygon in polygons for corner in polygon]
    footprint = surround(np.array(corners or held.box.footprint))
    (xs, ys), low, high = zip(*footprint, strict=True), held.box.minimum[2], held.box.maximum[2]
    placed = place_room(room, Box((min(xs), min(ys), low), (max(xs), max(ys), high)))
    return replace(placed, footprint=footprint, floor_area=room.floor_area)


def _set_levels(rooms: Sequence[Room], house: House) -> Sequence[Room]:
    """Return the rooms with the levels of the file, from 0 at the bottom.

    Where the file gives some room no level, the levels that the heights of floors show stay.
    """
    known = sorted((z, level) for level, z in enumerate(house.levels) if z is not None)
    rank = {level: number for number, (_, level) in enumerate(known)}
    levels = [house.regions[room.region_id].level for room in rooms]
    if not all(level in rank for level in levels):
        return rooms
    return [
        room if room.floor_z is None else replace(room, floor_index=rank[level])
        for room, level in zip(rooms, levels, strict=True)
    ]


ROW = SourceRow(
    summary="Matterport3D's .house files: levels, labelled rooms, objects with boxes",
    open=MatterportHouses,
    terms=Terms(
        licence="LicenseRef-matterport3d",
        licence_url="http://kaldir.vc.in.tum.de/matterport/MP_TOS.pdf",
        homepage="https://niessner.github.io/Matterport/",
        citation=(
            "Chang et al., Matterport3D: Learning from RGB-D Data in Indoor Environments, 3DV "
            "2017, arXiv:1709.06158"
        ),
        sentence=(
            "What is derived from Matterport3D stays under its terms of use, which allow "
            "non-commercial research and are to be signed before the data are downloaded."
        ),
    ),
    class_map="mp3d45-v1",
)
