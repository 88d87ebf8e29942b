"""Matterport3D's houses: levels, labelled rooms with their polygons, objects with their boxes."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
import numpy.typing as npt

from bsg_data.errors import SourceError
from bsg_data.geometry.adjacency import connect_rooms, measure_distance
from bsg_data.geometry.placement import find_storeys, surround
from bsg_data.inputs.bounded_file import PACKED
from bsg_data.inputs.bounds import HOUSE
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import Box, Edge, Point, Room, SceneGraph, SceneObject
from bsg_data.sources.annotation_files import (
    decode,
    fingerprint,
    list_files,
    read_listed,
    refuse_unreadable,
)
from bsg_data.sources.hm3d_names import keep_one_copy
from bsg_data.sources.house_file import NOWHERE, House, HouseObject, HouseRegion, parse_house
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SkippedScene, SourceRow, Terms

_SUFFIXES = (".house", f".house{PACKED}")
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
_UNNAMED = "-"  # the name of a category that has none
_JUNK = "Z"  # reflections in mirrors and points that float in space: no room


@dataclass(frozen=True)
class MatterportHouses:
    """A folder with `.house` files anywhere below it, packed or not, or one such file."""

    path: Path

    @property
    def kind(self) -> str:
        """`mp3d`."""
        return "mp3d"

    @property
    def options(self) -> dict[str, int | str]:
        """None: there is nothing to choose."""
        return {}

    def find(self) -> FoundScenes:
        """Find every `<house>.house` and `<house>.house.gz`."""
        unreadable: list[SkippedScene] = []
        files = list_files(self.path, _SUFFIXES, unreadable)
        if not files:
            refuse_unreadable(self.path, unreadable)
            raise SourceError(
                f"{self.path}: no house found; expected files named <house>.house or "
                "<house>.house.gz, which Matterport3D has in its house_segmentations"
            )
        return replace(
            keep_one_copy(self._refer(file) for file in files), unreadable=tuple(unreadable)
        )

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read one house; what no portal joins is left to the boxes of rooms and doors."""
        path = self.path if self.path.is_file() else self.path / ref.location
        data = read_listed(path, HOUSE, expected=ref.fingerprint)
        house = parse_house(decode(data, path=path), path=path)
        return Reading(_assemble(house, ref, hashlib.sha256(data).hexdigest(), class_map))

    def _refer(self, path: Path) -> SceneRef:
        name = path.name.removesuffix(PACKED).removesuffix(".house")
        where = path.name if path == self.path else path.relative_to(self.path).as_posix()
        return SceneRef(
            scene_id=name,
            location=where,
            fingerprint=fingerprint(path, HOUSE),
            source_split=None,
            source_version=None,
        )


def _assemble(house: House, ref: SceneRef, sha256: str, class_map: ClassMap) -> SceneGraph:
    """Make the scene graph of a house; objects of junk belong to the building."""
    regions = [n for n, region in enumerate(house.regions) if region.label != _JUNK]
    place = {region: index for index, region in enumerate(regions, start=1)}
    rooms = [_room(house, region, index) for region, index in place.items()]
    storeys = find_storeys(rooms)
    graph = SceneGraph(
        scene_id=ref.scene_id,
        source="mp3d",
        source_version=ref.source_version,
        source_split=ref.source_split,
        annotation_sha256=sha256,
        rooms=_set_levels(storeys, [house.regions[n].level for n in regions], house.levels),
        objects=tuple(
            _object(house, obj, place.get(obj.region, SceneObject.BUILDING), class_map)
            for obj in house.objects
        ),
        class_map=class_map.version,
    )
    pairs = [(place[a], place[b]) for a, b in house.portals if a in place and b in place]
    return _join(connect_rooms(graph), pairs)


def _room(house: House, region: int, index: int) -> Room:
    """Return a room with the box and the footprint of its region, if that has any."""
    held = house.regions[region]
    said, common = REGION_LABELS.get(held.label), label_of("mp3d", held.label)
    area = _measure_floor(held)
    room = Room(index, region, source_label=said, label=common, floor_area=area)
    if held.box is None:
        return room
    footprint = surround(_corners(held, held.box))
    (xs, ys), low, high = zip(*footprint, strict=True), held.box.minimum[2], held.box.maximum[2]
    box = Box((min(xs), min(ys), low), (max(xs), max(ys), high))
    return replace(
        room,
        box=box,
        centroid=_middle(box),
        floor_z=low,
        footprint=footprint,
    )


def _corners(region: HouseRegion, box: Box) -> npt.NDArray[np.float64]:
    """Return the corners of a region from above `[P, 2]`: of its polygons, else of its box."""
    corners = [corner for polygon in region.polygons for corner in polygon]
    (a, b, _), (c, d, _) = box.minimum, box.maximum
    return np.array(corners or [(a, b), (c, b), (c, d), (a, d)])


def _measure_floor(region: HouseRegion) -> float | None:
    """Return the area of a region's floor polygons, square metres; None without one."""
    areas = [
        sum(a * d - c * b for (a, b), (c, d) in pairwise([*polygon, polygon[0]]))
        for polygon in region.polygons
    ]
    return sum(abs(area) for area in areas) / 2 or None


def _set_levels(
    rooms: Sequence[Room], levels: Sequence[int], heights: Sequence[float | None]
) -> tuple[Room, ...]:
    """Return the rooms with the levels of the file, from 0 at the bottom.

    Where the file gives some room no level, the levels that the heights of floors show stay.
    """
    known = sorted((z, level) for level, z in enumerate(heights) if z is not None)
    rank = {level: number for number, (_, level) in enumerate(known)}
    if not all(level in rank for level in levels):
        return tuple(rooms)
    return tuple(
        room if room.floor_z is None else replace(room, floor_index=rank[level])
        for room, level in zip(rooms, levels, strict=True)
    )


def _object(house: House, obj: HouseObject, room: int, class_map: ClassMap) -> SceneObject:
    name = "" if obj.category == NOWHERE else house.categories[obj.category].name
    name = "" if name == _UNNAMED else name
    known = class_map.classify(name)
    return SceneObject(
        object_index=obj.index + 1,
        instance_id=obj.index,
        room_index=room,
        raw_category=name,
        category=known.category,
        class_index=known.class_index,
        role=known.role,
        centroid=None if obj.box is None else _middle(obj.box),
        box=obj.box,
        part_box=obj.box,
    )


def _middle(box: Box) -> Point:
    x, y, z = ((low + high) / 2 for low, high in zip(box.minimum, box.maximum, strict=True))
    return x, y, z


def _join(graph: SceneGraph, pairs: Sequence[tuple[int, int]]) -> SceneGraph:
    """Return the scene graph with the portals of the file among its connections, as doors."""
    edges = {(edge.source, edge.target): edge for edge in graph.adjacency}
    for one, other in pairs:
        distance = measure_distance(graph.rooms[one - 1], graph.rooms[other - 1])
        edges[one, other] = Edge(one, other, "adjacent", "door", distance)
    return replace(graph, adjacency=tuple(edges[pair] for pair in sorted(edges)))


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
