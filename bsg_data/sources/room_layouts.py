"""Read room layouts of DomestiGraph (Gallagher et al. 2024): labels, boxes and connections.

There is one YAML file per building, `<scene id>.yaml`. It has `rooms` named `room_k`, each with
`label`, `centroid` and `dims` in metres, Y up, and `connections` as pairs of k. Room k is the k-th
region of the annotation by id, from 1. A layout may lack rooms.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bsg_data.errors import SourceChangedError, SourceError, find_io_error
from bsg_data.files import AnyPath
from bsg_data.geometry.adjacency import measure_distance
from bsg_data.geometry.placement import find_storeys, measure_area
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import LAYOUT
from bsg_data.inputs.documents import parse_yaml
from bsg_data.recipes import name_fault
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import LAYOUTS, label_of
from bsg_data.scene.scene_graph import Box, Edge, Room, SceneGraph, is_scene_id
from bsg_data.scene.scene_id import building_hash
from bsg_data.sources.annotation_files import fingerprint, require_fingerprint
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SkippedScene, Source

_LAYOUT = ", layout "  # before the hash of a layout, in what tells of a scene's geometry
MAX_METRES = 10_000.0
_NAME = re.compile(r"room_([1-9][0-9]{0,5})")


class LayoutError(SourceError):
    """Report a layout that is malformed or does not belong to its scene."""


Metres = Annotated[float, Field(ge=-MAX_METRES, le=MAX_METRES)]
Length = Annotated[float, Field(ge=0, le=MAX_METRES)]
Number = Annotated[int, Field(ge=0, le=10**6)]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class _Place(_Entry):
    x: Metres
    y: Metres
    z: Metres


class _Size(_Entry):
    x: Length
    y: Length
    z: Length


class _LayoutRoom(_Entry):
    label: Annotated[str, Field(min_length=1, max_length=200)]
    centroid: _Place
    dims: _Size


class _Layout(_Entry):
    rooms: Annotated[dict[str, _LayoutRoom], Field(min_length=1)]
    connections: tuple[tuple[Number, Number], ...] = ()


@dataclass(frozen=True, slots=True)
class RoomLayout:
    """The layout of one building.

    Attributes:
        rooms: label and box of every room by its number k; metres, Z up.
        connections: pairs of numbers, ascending and once each.
    """

    rooms: dict[int, tuple[str, Box]]
    connections: tuple[tuple[int, int], ...]


def read_layout(path: Path) -> RoomLayout:
    """Read one layout.

    Raises:
        LayoutError: naming the file, the entry, and what was expected there.
    """
    try:
        data = read_bytes(path, LAYOUT, error=LayoutError)
        parsed = _Layout.model_validate(parse_yaml(data))
    except ValidationError as error:
        raise LayoutError(f"{path}: {name_fault(error)}") from error
    except ValueError as error:
        raise LayoutError(f"{path}: {error}") from error
    rooms = {}
    for name, room in parsed.rooms.items():
        match = _NAME.fullmatch(name)
        if match is None:
            raise LayoutError(f"{path}: rooms.{name}: expected a name like room_1")
        rooms[int(match[1])] = (room.label, _box(room))
    for pair in parsed.connections:
        for number in pair:
            if number not in rooms:
                raise LayoutError(f"{path}: connections: room_{number} is not among its rooms")
        if pair[0] == pair[1]:
            raise LayoutError(f"{path}: connections: room_{pair[0]} with itself")
    pairs = {(min(pair), max(pair)) for pair in parsed.connections}
    return RoomLayout(rooms, tuple(sorted(pairs)))


def _box(room: _LayoutRoom) -> Box:
    """Return the box of a room, Z up: of the layouts' axes, z points backwards."""
    middle = np.array([room.centroid.x, -room.centroid.z, room.centroid.y])
    half = np.array([room.dims.x, room.dims.z, room.dims.y]) / 2
    low, high = ((float(x), float(y), float(z)) for x, y, z in (middle - half, middle + half))
    return Box(low, high)


def lay_out(graph: SceneGraph, layout: RoomLayout) -> SceneGraph:
    """Return the scene graph with the labels and connections of a layout.

    Boxes come from the layout only if there is no mesh, because the origins may differ. Between
    rooms of the layout, its connections replace those of the mesh. All other rooms and connections
    stay as they are.

    Raises:
        LayoutError: if the layout has a room that is not in the scene.
    """
    beyond = [number for number in layout.rooms if number > len(graph.rooms)]
    if beyond:
        raise LayoutError(
            f"room_{min(beyond)} is not among the {len(graph.rooms)} rooms of {graph.scene_id}; "
            f"the layout ({len(layout.rooms)} rooms) is of another scene or another version"
        )
    rooms = [
        _lay_out_room(room, *layout.rooms[room.room_index], placed=graph.up_axis is not None)
        if room.room_index in layout.rooms
        else room
        for room in graph.rooms
    ]
    edges = [
        Edge(a, b, "adjacent", "layout", measure_distance(rooms[a - 1], rooms[b - 1]))
        for a, b in layout.connections
    ]
    edges += [
        edge for edge in graph.adjacency if not {edge.source, edge.target} <= set(layout.rooms)
    ]
    edges.sort(key=lambda edge: (edge.source, edge.target))
    placed = tuple(rooms) if graph.up_axis is not None else find_storeys(rooms)
    return replace(graph, rooms=placed, adjacency=tuple(edges))


def _lay_out_room(room: Room, label: str, box: Box, *, placed: bool) -> Room:
    """Return the room with its label, and with its box unless a mesh placed the building."""
    if placed:
        return replace(room, source_label=label, label=label_of(LAYOUTS, label))
    (a, b, _), (c, d, _) = box.minimum, box.maximum
    x, y, z = (float(v) for v in np.mean([box.minimum, box.maximum], axis=0))
    footprint = ((a, b), (c, b), (c, d), (a, d))
    return replace(
        room,
        source_label=label,
        label=label_of(LAYOUTS, label),
        box=box,
        centroid=(x, y, z),
        floor_z=box.minimum[2],
        footprint=footprint,
        floor_area=measure_area(footprint),
    )


@dataclass(frozen=True)
class WithLayouts:
    """A source combined with a folder of room layouts.

    Attributes:
        source: source of the scene graphs.
        folder: folder with `<scene id>.yaml` or `<hash>.yaml` for some of its scenes.
    """

    source: Source
    folder: Path

    def __init__(self, source: Source, folder: AnyPath) -> None:
        object.__setattr__(self, "source", source)
        object.__setattr__(self, "folder", Path(folder))

    @property
    def kind(self) -> str:
        """The kind of the source itself."""
        return self.source.kind

    @property
    def path(self) -> Path:
        """The path of the source itself."""
        return self.source.path

    @property
    def options(self) -> dict[str, int | str]:
        """The source's options, and a mark that there are layouts."""
        return {**self.source.options, "room_layouts": 1}

    def find(self) -> FoundScenes:
        """Find the scenes of the source, and the layouts that belong to no scene.

        Raises:
            SourceError: as the source does, or if no layout belongs to any scene.
        """
        if not self.folder.is_dir():
            raise SourceError(f"{self.folder}: no such folder of room layouts")
        own = self.source.find()
        files = sorted(self.folder.glob("*.yaml"))
        scenes = tuple(self._refer(ref) for ref in own.scenes)
        used = {path for ref in own.scenes if (path := self._layout_of(ref)) is not None}
        if not files:
            raise SourceError(f"{self.folder}: holds no .yaml file")
        if not used:
            raise SourceError(
                f"{self.folder}: none of its {len(files)} layouts belongs to a scene of "
                f"{self.source.path}; expected names like {own.scenes[0].scene_id}.yaml"
            )
        unused = tuple(
            SkippedScene(path.stem, path.name, "a room layout of no scene of the source")
            for path in files
            if path not in used
        )
        return replace(own, scenes=scenes, unused=unused)

    def read(self, ref: SceneRef, class_map: ClassMap) -> Reading:
        """Read a scene and its layout; an unusable layout is left out, with the reason."""
        own = replace(ref, geometry=str(ref.geometry).rpartition(_LAYOUT)[0] or ref.geometry)
        reading = self.source.read(own, class_map)
        where = f"{self.folder}: the layout of {ref.scene_id}"
        require_fingerprint(where, str(self._refer(own).geometry), str(ref.geometry))
        path = self._layout_of(ref)
        if path is None:
            return reading
        try:
            layout = read_layout(path)
            try:
                return replace(reading, graph=lay_out(reading.graph, layout))
            except LayoutError as error:
                raise LayoutError(f"{path}: {error}") from error
        except LayoutError as error:
            if find_io_error(error):
                raise SourceChangedError(str(error)) from error
            reason = str(error).replace(f"{self.folder}/", "")
            skip = SkippedScene(ref.scene_id, path.name, reason)
            return replace(reading, left_out=(*reading.left_out, skip))

    def _layout_of(self, ref: SceneRef) -> Path | None:
        if not is_scene_id(ref.scene_id):  # its name could lead out of the folder
            return None
        names = (ref.scene_id, building_hash(ref.scene_id))
        paths = (self.folder / f"{name}.yaml" for name in names)
        return next((path for path in paths if path.is_file()), None)

    def _refer(self, ref: SceneRef) -> SceneRef:
        path = self._layout_of(ref)
        if path is None:
            return ref
        return replace(ref, geometry=f"{ref.geometry}{_LAYOUT}{fingerprint(path, LAYOUT)}")
