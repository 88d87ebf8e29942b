"""Matterport3D's houses: levels, labelled rooms with their polygons, objects with their boxes."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from bsg_data.geometry.adjacency import connect_rooms
from bsg_data.geometry.placement import find_storeys, measure_area, surround
from bsg_data.inputs.bounds import HOUSE
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import Box, Room, SceneObject
from bsg_data.sources.annotation_files import decode, find_files, read_listed
from bsg_data.sources.assembly import assemble, connect, place_room
from bsg_data.sources.house_file import NOWHERE, House, HouseRegion, parse_house
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
        regions = [n for n, region in enumerate(house.regions) if region.label != _JUNK]
        storeys = find_storeys([_room(house.regions[n], n) for n in regions])
        graph = assemble(
            _list_objects(house),
            ref=ref,
            kind=self.kind,
            sha256=hashlib.sha256(data).hexdigest(),
            class_map=class_map,
            rooms=_set_levels(storeys, house),
        )
        index = {room.region_id: room.room_index for room in graph.rooms}
        doors = [(index[a], index[b]) for a, b in house.portals if a in index and b in index]
        return Reading(connect(connect_rooms(graph), doors, method="door"))


def _list_objects(house: House) -> Iterator[SceneObject]:
    for number, (region, category, box) in enumerate(house.objects):
        name = "" if category == NOWHERE else house.categories[category]
        is_placed = region != NOWHERE and house.regions[region].label != _JUNK
        yield SceneObject(
            object_index=0,
            instance_id=number,
            room_index=region if is_placed else NOWHERE,
            raw_category="" if name == _UNNAMED else name,
            centroid=None if box is None else box.centre,
            box=box,
            part_box=box,
        )


def _room(held: HouseRegion, region: int) -> Room:
    """Return a room with the box and the footprint of its region, if that has any."""
    room = Room(
        room_index=0,
        region_id=region,
        source_label=REGION_LABELS.get(held.label),
        label=label_of("mp3d", held.label),
        floor_area=sum(measure_area(polygon) or 0.0 for polygon in held.polygons) or None,
    )
    if held.box is None:
        return room
    corners = [corner for polygon in held.polygons for corner in polygon]
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
