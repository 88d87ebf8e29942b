"""Read the files of room layouts: what they say of the rooms of one building.

DomestiGraph (Gallagher et al. 2024) has one YAML file per building, `<scene id>.yaml`. Its `rooms`
are named `room_k` and have `label`, or `centroid` and `dims`, or all, in metres, Y up;
`connections` are pairs of k. Room k is the k-th region of the annotation by id, from 1.

habitat-sim has `<scene id>.semantic_config.json` with `region_annotations`, in metres, Y up, which
`bsg_data.exports.habitat` writes. A table has the columns `scene`, `region` and `label`. Both name
a room by its region id. A layout may lack rooms.
"""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import numpy as np
from pydantic import Field, ValidationError, model_validator

from bsg_data.errors import SourceError
from bsg_data.geometry.placement import surround
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.documents import parse_yaml, read_json
from bsg_data.records import MAX_METRES, ForeignRecord, Keyed, Listed, Metres, Position, name_fault
from bsg_data.scene.scene_graph import Box, Point
from bsg_data.scene.surroundings import measure_area
from bsg_data.sources.annotation_files import once_for_each_state
from bsg_data.sources.label_table import read_labels
from bsg_data.sources.source import AnnotatedRoom
from bsg_data.words.shown import show_value

CONFIG_SUFFIX = ".semantic_config.json"
SUFFIXES = (".yaml", ".yml", CONFIG_SUFFIX)
NO_LABEL = "room"  # of a region without a label: habitat-sim makes a category of every label
_REGION = re.compile(r"(-?[0-9]{1,9})(?:\.0*)?")  # 3.0 is how pandas writes 3 in a column with gaps
_COLUMNS = {  # with their names in HM3D's statistics
    "scene": ("Scene Name",),
    "region": ("Region #",),
    "label": ("Region Category", "Room Proposal", "Weighted Room Proposal"),
}


class LayoutError(SourceError):
    """Report a layout that is malformed or does not belong to its scene."""


@dataclass(frozen=True, slots=True)
class RoomLayout:
    """The layout of one building."""

    rooms: Mapping[int, AnnotatedRoom]  # by region id, or by k
    by_region: bool  # whether the keys are region ids
    # pairs of k, ascending and once each; None if the layout says nothing of connections
    connections: tuple[tuple[int, int], ...] | None = None


_Length = Annotated[float, Field(ge=0, le=MAX_METRES)]
_Number = Annotated[int, Field(ge=0, le=10**6)]
_Name = Annotated[str, Field(pattern=r"^room_[1-9][0-9]{0,5}$")]
_Label = Annotated[str, Field(min_length=1, max_length=200)]
_Point = tuple[Metres, Metres, Metres]


class _Size(ForeignRecord):
    x: _Length
    y: _Length
    z: _Length


def _require_both(first: str, second: str, values: Mapping[str, Any]) -> None:
    """Refuse half a box."""
    given, absent = (first, second) if values[second] is None else (second, first)
    if values[given] is not None and values[absent] is None:
        raise ValueError(
            f"has half a box: {given} without {absent}; give both, or neither for a label alone"
        )


class _LayoutRoom(ForeignRecord):
    label: _Label | None = None
    centroid: Position | None = None
    dims: _Size | None = None

    @model_validator(mode="after")
    def _says_something(self) -> _LayoutRoom:
        _require_both("centroid", "dims", vars(self))
        if self.label is None and self.centroid is None:
            raise ValueError("expected a label, or centroid and dims, or all three; found none")
        return self

    def describe(self, number: int) -> AnnotatedRoom:
        box = None
        if self.centroid and self.dims:
            x, y, z = _upright((self.centroid.x, self.centroid.y, self.centroid.z))
            a, b, c = self.dims.x / 2, self.dims.z / 2, self.dims.y / 2
            box = Box((x - a, y - b, z - c), (x + a, y + b, z + c))
        return AnnotatedRoom(region=number, source_label=self.label, box=box)


class _Layout(ForeignRecord):
    rooms: Annotated[Keyed[_Name, _LayoutRoom], Field(min_length=1)]
    connections: Listed[tuple[_Number, _Number]] | None = None


class _Region(ForeignRecord):
    name: Annotated[str, Field(pattern="^region_[0-9]{1,9}$")]  # with its id in the annotation
    label: Annotated[str, Field(max_length=200)] = NO_LABEL
    poly_loop: Annotated[Listed[_Point], Field(min_length=3)] | None = None
    min_bounds: _Point | None = None
    max_bounds: _Point | None = None

    @model_validator(mode="after")
    def _has_an_ordered_box(self) -> _Region:
        _require_both("min_bounds", "max_bounds", vars(self))
        if self.min_bounds and self.max_bounds:
            for axis, low, high in zip("xyz", self.min_bounds, self.max_bounds, strict=True):
                if high < low:
                    raise ValueError(f"max_bounds.{axis}: expected {low} or more, found {high}")
        return self

    def describe(self, number: int) -> AnnotatedRoom:
        """Return the room; its box is as wide as its footprint."""
        label = None if self.label in ("", NO_LABEL) else self.label
        room = AnnotatedRoom(region=number, source_label=label)
        if self.min_bounds is None or self.max_bounds is None:
            return room
        ends = np.array([_upright(self.min_bounds), _upright(self.max_bounds)])
        if self.poly_loop is None:
            return replace(room, box=Box.around(ends))
        corners = [_upright(corner)[:2] for corner in self.poly_loop]
        footprint = surround(np.array(corners))
        box = Box.around(np.array([(x, y, z) for x, y in footprint for z in ends[:, 2]]))
        area = measure_area(corners) or measure_area(box.footprint)
        return replace(room, box=box, footprint=footprint, floor_area=area)


class _Regions(ForeignRecord):
    region_annotations: Annotated[Listed[_Region], Field(min_length=1)]


def _upright(point: Point) -> Point:
    """Return a point of a layout in our axes: Z up; its z points backwards."""
    x, y, z = point
    return x, 0.0 - z, y  # and never -0.0


def read_layout(path: Path) -> RoomLayout:
    """Read the layout of one building, by the name of its file."""
    try:
        return _read_regions(path) if path.name.endswith(CONFIG_SUFFIX) else _read_yaml(path)
    except ValueError as error:
        fault = name_fault(error) if isinstance(error, ValidationError) else error
        raise LayoutError(f"{path}: {fault}", code="layout-malformed", where=path) from error


def _read_yaml(path: Path) -> RoomLayout:
    parsed = _Layout.model_validate(parse_yaml(read_bytes(path, error=LayoutError)))
    numbered = ((int(name[len("room_") :]), room) for name, room in parsed.rooms.items())
    rooms = {number: room.describe(number) for number, room in numbered}
    if parsed.connections is None:
        return RoomLayout(rooms, by_region=False)
    for first, second in parsed.connections:
        if first == second or not {first, second} <= set(rooms):
            raise ValueError(f"connections: expected two of its rooms, found {first} and {second}")
    pairs = {(min(pair), max(pair)) for pair in parsed.connections}
    return RoomLayout(rooms, by_region=False, connections=tuple(sorted(pairs)))


def _read_regions(path: Path) -> RoomLayout:
    parsed = _Regions.model_validate(read_json(path, error=LayoutError))
    rooms: dict[int, AnnotatedRoom] = {}
    for region in parsed.region_annotations:
        number = int(region.name[len("region_") :])
        if number in rooms:
            raise ValueError(f"region_annotations: {region.name} is there twice")
        rooms[number] = region.describe(number)
    return RoomLayout(rooms, by_region=True)


@once_for_each_state
def read_layout_table(path: Path) -> tuple[dict[str, RoomLayout], list[str]]:
    """Return scene id or key of a building → its layout, and the columns that are not read."""
    labels, unread = read_labels(path, _COLUMNS, _read_key)
    rooms: dict[str, dict[int, AnnotatedRoom]] = {}
    for (scene, region), (label, _) in sorted(labels.items()):
        if label:  # else nothing is known of the room
            room = AnnotatedRoom(region=region, source_label=label)
            rooms.setdefault(scene, {})[region] = room
    return {scene: RoomLayout(held, by_region=True) for scene, held in rooms.items()}, unread


def _read_key(where: str, cells: list[str]) -> tuple[str, int]:
    scene, region = cells
    number = _REGION.fullmatch(region)
    if not scene or number is None:
        raise SourceError(
            f"{where}: expected the name of a scene, and as region the id in the last column of "
            f"its annotation; found {show_value(scene)}, {show_value(region)}",
            code="row-malformed",
            where=where,
        )
    return scene, int(number[1])
