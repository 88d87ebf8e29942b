"""Matterport3D's houses: `.house` text with levels, labelled rooms and their polygons, objects.

The first line is `ASCII 1.1`; every other begins with a letter that says what it is (niessner/
Matterport, data_organization.md): H counts the others, L levels, R regions, P portals, S
surfaces, V the vertices of their polygons, C categories, O objects. P panoramas, I images and E
segments are not read, and so not counted. A portal is a P by the description and an R by the
program that writes the files; its 15 fields tell it from both. Indices run from 0 and refer to
earlier lines. Metres; z points up.
"""

from __future__ import annotations

import hashlib
import math
import re
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import ClassVar

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.dataset.manifest import SkippedScene
from bsg_data.geometry.adjacency import connect_rooms
from bsg_data.geometry.placement import surround
from bsg_data.records import MAX_METRES
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import Box
from bsg_data.scene.surroundings import measure_area
from bsg_data.sources.annotation_files import decode, find_files, malformed, read_scene_file
from bsg_data.sources.assembly import assemble, connect
from bsg_data.sources.source import (
    AnnotatedRoom,
    Annotation,
    FoundScenes,
    Reading,
    SceneRef,
    SourceRow,
)
from bsg_data.terms import Terms
from bsg_data.words.shown import SHOWN

# The letters of regions, in the words of the format's description.
_REGION_LABELS = {
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
_NOWHERE = -1  # the index of no level, no region or no category
_UNNAMED = "-"  # the name of a category that has none
_JUNK = "Z"  # reflections in mirrors and points that float in space: no room
_WHOLE = re.compile(r"-?[0-9]{1,9}")
_PORTAL_FIELDS = 15  # with its label as the fifth; a panorama has 13, a region 20 with a 0 there
_LONGEST_AXIS = 1.01  # of a unit vector that was rounded
# What H counts, in its order, and the letter of the lines that it counts; E is named #segments.
_COUNTED = ("I", "panorama", "V", "S", "E", "O", "C", "R", "portal", "L")
_REQUIRED = frozenset("OCRL")  # a file with other numbers of these is another house
# What a file may lack, and what is done then.
_FLOORS = "the floors of rooms are those of their boxes, without an area"
_OPTIONAL = {"V": _FLOORS, "S": _FLOORS, "portal": "doors and boxes tell what else connects"}


@dataclass(frozen=True)
class _MatterportHouses:
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
        return find_files(self.path, ".house", expected=expected)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one house; what no portal joins is left to the boxes of rooms and doors.

        Regions of junk are no rooms, and their objects belong to the building.
        """
        path, data = read_scene_file(self.path, ref)
        house = _parse_house(data, path=path)
        boxes = [box for _, _, box in house.objects]
        annotation = Annotation(
            [_NOWHERE if house.is_junk(region) else region for region, _, _ in house.objects],
            [house.name_of(category) for _, category, _ in house.objects],
            ids=range(len(house.objects)),
            boxes=boxes,
            parts=boxes,
            rooms=_describe_rooms(house),
            sha256=hashlib.sha256(data).hexdigest(),
        )
        graph = assemble(annotation, ref=ref, kind=self.kind, class_map=class_map)
        index = {room.region_id: room.room_index for room in graph.rooms}
        doors = [(index[a], index[b]) for a, b in house.portals if a in index and b in index]
        return Reading(
            connect(connect_rooms(graph), doors, method="door"),
            left_out=tuple(SkippedScene(ref.scene_id, ref.location, why) for why in house.lacking),
        )


@dataclass(slots=True)
class _Region:
    level: int  # index of its level; `_NOWHERE` without one
    label: str  # its letter, `k` for a kitchen; `-` without one
    box: Box | None  # around it, metres; None for an empty region
    # of its floor, corners (x, y) as the file orders them; metres; less than three are none
    polygons: list[list[tuple[float, float]]] = field(default_factory=list)


@dataclass(slots=True)
class _House:
    """What the lines of a `.house` file said so far; all in the order of their indices."""

    counted: Counter[str] = field(default_factory=Counter)  # lines by their kinds
    levels: list[float | None] = field(default_factory=list)  # lowest z; None for an empty one
    regions: list[_Region] = field(default_factory=list)
    surfaces: list[list[tuple[float, float]]] = field(default_factory=list)  # polygons of regions
    portals: set[tuple[int, int]] = field(default_factory=set)  # of two regions, ascending
    categories: list[str] = field(default_factory=list)
    # region, category and axis-aligned box; `_NOWHERE` without the first two, None without a box
    objects: list[tuple[int, int, Box | None]] = field(default_factory=list)
    lacking: list[str] = field(default_factory=list)  # sentences: lines that H counts otherwise

    def is_junk(self, region: int) -> bool:
        """Say whether an object of a region is in no room."""
        return region == _NOWHERE or self.regions[region].label == _JUNK

    def name_of(self, category: int) -> str:
        """Return the name of a category; empty without one."""
        name = "" if category == _NOWHERE else self.categories[category]
        return "" if name == _UNNAMED else name

    def add(self, kind: str, line: Sequence[str]) -> None:
        """Take up the fields of one line, which may refer to earlier ones alone.

        Raises:
            ValueError: that says what was expected.
        """
        if kind in set("LRSCO") and _whole(line, 1, "its index") != self.counted[kind]:
            raise ValueError(f"the next index, {self.counted[kind]}")
        if kind == "L":
            box = _box(line, 7)
            self.levels.append(None if box is None else box.minimum[2])
        elif kind == "R":
            level = _refer(line, 2, "a level", self.levels)
            self.regions.append(_Region(level, line[5], _box(line, 9)))
        elif kind == "portal":
            first, second = sorted(_refer(line, at, "a region", self.regions) for at in (2, 3))
            if first != second and first != _NOWHERE:
                self.portals.add((first, second))
        elif kind == "S":
            region = _refer(line, 2, "a region", self.regions)
            self.surfaces.append([])
            if region != _NOWHERE:
                self.regions[region].polygons.append(self.surfaces[-1])
        elif kind == "V":
            surface = _refer(line, 2, "a surface", self.surfaces)
            (x, y, _) = _points(line, 4, 1)[0].tolist()
            if surface != _NOWHERE:
                self.surfaces[surface].append((x, y))
        elif kind == "C":
            self.categories.append(line[3].replace("#", " "))
        elif kind == "O":
            region = _refer(line, 2, "a region", self.regions)
            category = _refer(line, 3, "a category", self.categories)
            self.objects.append((region, category, _enclose(_points(line, 4, 4))))
        elif kind not in ("H", *_COUNTED):
            raise ValueError("a line of H, L, R, P, S, V, I, C, O or E")
        self.counted[kind] += 1


def _parse_house(data: bytes, *, path: Path) -> _House:
    """Parse a `.house` file; the error names the first malformed line."""
    first, *lines = decode(data, path=path).split("\n")
    if first.strip() != _HEADER:
        raise malformed(path, 1, first, expected=repr(_HEADER))
    house, header, found = _House(), 1, first
    for number, line in enumerate(lines, start=2):
        if fields := line.split():
            if fields[0] == "H":
                header, found = number, line
            try:
                house.add(_kind_of(fields), fields)
            except (ValueError, IndexError) as error:
                expected = "more fields" if isinstance(error, IndexError) else str(error)
                raise malformed(path, number, line, expected=expected) from error
    if house.counted["H"] != 1:
        raise malformed(path, header, found, expected="one header in all, a line of H")
    stated = (*(word[:SHOWN] for word in found.split()), *("" for _ in _COUNTED))
    for column, kind in enumerate(_COUNTED, start=3):
        counted = str(house.counted[kind])
        if kind in _REQUIRED and stated[column] != counted:
            expected = f"{counted} lines of {kind} as field {column + 1} of H"
            raise malformed(path, header, found, expected=expected)
        if kind in _OPTIONAL and stated[column] != counted:
            fault = f"H counts {stated[column] or 'no'} {kind} lines, and {counted} are there"
            house.lacking.append(f"{fault}: {_OPTIONAL[kind]}")
            if _OPTIONAL[kind] == _FLOORS:  # a polygon without some of its lines is another
                for region in house.regions:
                    region.polygons.clear()
    return house


def _kind_of(line: Sequence[str]) -> str:
    if line[0] in ("P", "R") and len(line) == _PORTAL_FIELDS and line[4] != "0":
        return "portal"
    return "panorama" if line[0] == "P" else line[0]


def _whole(line: Sequence[str], at: int, what: str) -> int:
    if not _WHOLE.fullmatch(line[at]):
        raise ValueError(f"{what}, a whole number, as field {at + 1} of {line[0]}")
    return int(line[at])


def _refer(line: Sequence[str], at: int, what: str, among: Sequence[object]) -> int:
    index = _whole(line, at, what)
    if not _NOWHERE <= index < len(among):
        raise ValueError(f"{what} that an earlier line has (0..{len(among) - 1}), or {_NOWHERE}")
    return index


def _points(line: Sequence[str], at: int, count: int, *, bound: float = MAX_METRES) -> Floats:
    """Return points `[count, 3]` of some fields, metres."""
    try:
        found = np.array([float(word) for word in line[at : at + 3 * count]]).reshape(count, 3)
    except ValueError:
        found = np.array([math.nan])
    if not (np.abs(found) <= bound).all():  # nan is not
        raise ValueError(f"{3 * count} numbers of metres from field {at + 1} of {line[0]} on")
    return found


def _box(line: Sequence[str], at: int) -> Box | None:
    """Return a box; None for an empty one, which is written inside out, perhaps by 1e20."""
    low, high = _points(line, at, 2, bound=math.inf)
    if (low > high).all():
        return None
    if (low > high).any():
        raise ValueError("a box whose lowest corner is not above its highest")
    return Box.around(_points(line, at, 2))


def _enclose(oriented: Floats) -> Box | None:
    """Return the axis-aligned box around an oriented one; None for an empty one.

    It is `[4, 3]`: centre, two axes and radii. The axes are unit vectors, and the third is their
    cross product; an empty box has radii below 0.
    """
    centre, a, b, radii = oriented
    if radii.min() < 0:
        return None
    if np.linalg.norm([a, b], axis=1).max() > _LONGEST_AXIS:
        raise ValueError("axes of length 1")
    reach = (np.abs([a, b, np.cross(a, b)]) * radii[:, None]).sum(axis=0)
    return Box.around(np.array([centre - reach, centre + reach]))


def _describe_rooms(house: _House) -> Iterator[AnnotatedRoom]:
    """Yield the rooms, with the box and the footprint of their regions, if these have any.

    Levels count from 0 at the bottom. Where the file gives some room none, heights tell them.
    """
    regions = {n: region for n, region in enumerate(house.regions) if region.label != _JUNK}
    known = sorted((z, level) for level, z in enumerate(house.levels) if z is not None)
    rank = {level: number for number, (_, level) in enumerate(known)}
    is_levelled = all(region.level in rank for region in regions.values())
    for region, held in regions.items():
        polygons = [polygon for polygon in held.polygons if len(polygon) > 2]
        area = sum(measure_area(polygon) or 0.0 for polygon in polygons) or None
        corners = [corner for polygon in polygons for corner in polygon]
        box = footprint = None
        if held.box is not None:
            footprint = surround(np.array(corners or held.box.footprint))
            heights = (held.box.minimum[2], held.box.maximum[2])
            box = Box.around(np.array([(x, y, z) for x, y in footprint for z in heights]))
        yield AnnotatedRoom(
            region=region,
            source_label=_REGION_LABELS.get(held.label),
            label=label_of("mp3d", held.label),
            box=box,
            footprint=footprint,
            floor_area=area,
            floor_index=rank[held.level] if is_levelled and box else None,
        )


ROW = SourceRow(
    summary="Matterport3D's .house files: levels, labelled rooms, objects with boxes",
    open=_MatterportHouses,
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
