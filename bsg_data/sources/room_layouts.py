"""Read room layouts of DomestiGraph (Gallagher et al. 2024): labels, boxes and connections.

There is one YAML file per building, `<scene id>.yaml`. It has `rooms` named `room_k`, each with
`label`, `centroid` and `dims` in metres, Y up, and `connections` as pairs of k. Room k is the k-th
region of the annotation by id, from 1. A layout may lack rooms.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from bsg_data.errors import SourceError
from bsg_data.files import AnyPath
from bsg_data.geometry.placement import find_storeys
from bsg_data.inputs.bounded_file import read_bytes
from bsg_data.inputs.bounds import LAYOUT
from bsg_data.inputs.documents import parse_yaml
from bsg_data.recipes import name_fault
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import LAYOUTS, label_of
from bsg_data.scene.scene_graph import Box, SceneGraph, building_hash, is_scene_id
from bsg_data.sources.annotation_files import fingerprint, require_fingerprint, require_lasting
from bsg_data.sources.assembly import connect, place_room
from bsg_data.sources.source import FoundScenes, Reading, SceneRef, SkippedScene, Source

_LAYOUT = ", layout "  # before the hash of a layout, in what tells of a scene's geometry
_MAX_METRES = 10_000.0


class LayoutError(SourceError):
    """Report a layout that is malformed or does not belong to its scene."""


_Metres = Annotated[float, Field(ge=-_MAX_METRES, le=_MAX_METRES)]
_Length = Annotated[float, Field(ge=0, le=_MAX_METRES)]
_Number = Annotated[int, Field(ge=0, le=10**6)]
_Name = Annotated[str, Field(pattern=r"^room_[1-9][0-9]{0,5}$")]


class _Entry(BaseModel):
    model_config = ConfigDict(extra="ignore", frozen=True)


class _Place(_Entry):
    x: _Metres
    y: _Metres
    z: _Metres


class _Size(_Entry):
    x: _Length
    y: _Length
    z: _Length


class _LayoutRoom(_Entry):
    label: Annotated[str, Field(min_length=1, max_length=200)]
    centroid: _Place
    dims: _Size

    @property
    def box(self) -> Box:
        """The box, Z up: of the layouts' axes, z points backwards."""
        x, y, z = self.centroid.x, -self.centroid.z, self.centroid.y
        a, b, c = self.dims.x / 2, self.dims.z / 2, self.dims.y / 2
        return Box((x - a, y - b, z - c), (x + a, y + b, z + c))


class _Layout(_Entry):
    rooms: Annotated[dict[_Name, _LayoutRoom], Field(min_length=1)]
    connections: tuple[tuple[_Number, _Number], ...] = ()


@dataclass(frozen=True, slots=True)
class _RoomLayout:
    """The layout of one building."""

    rooms: dict[int, tuple[str, Box]]  # label and box of every room by its number k; metres, Z up
    connections: tuple[tuple[int, int], ...]  # pairs of numbers, ascending and once each


def read_layout(path: Path) -> _RoomLayout:
    """Read one layout."""
    try:
        parsed = _Layout.model_validate(parse_yaml(read_bytes(path, LAYOUT, error=LayoutError)))
    except ValueError as error:
        said = name_fault(error) if isinstance(error, ValidationError) else error
        raise LayoutError(f"{path}: {said}", code="layout-malformed", where=path) from error
    rooms = {int(name[len("room_") :]): (one.label, one.box) for name, one in parsed.rooms.items()}
    for one, other in parsed.connections:
        if one == other or not {one, other} <= set(rooms):
            raise LayoutError(
                f"{path}: connections: expected two of its rooms, found {one} and {other}",
                code="room-unknown",
                where=path,
            )
    return _RoomLayout(rooms, tuple(sorted({(min(p), max(p)) for p in parsed.connections})))


def lay_out(graph: SceneGraph, layout: _RoomLayout) -> SceneGraph:
    """Return the scene graph with the labels and connections of a layout.

    Boxes come from the layout only if there is no mesh, because the origins may differ. Between
    rooms of the layout, its connections replace those of the mesh. All other rooms and connections
    stay as they are.
    """
    beyond = [number for number in layout.rooms if number > len(graph.rooms)]
    if beyond:
        raise LayoutError(
            f"room_{min(beyond)} is not among the {len(graph.rooms)} rooms of {graph.scene_id}; "
            f"the layout ({len(layout.rooms)} rooms) is of another scene or another version",
            code="layout-foreign",
            where=graph.scene_id,
        )
    rooms, is_placed = list(graph.rooms), graph.up_axis is not None
    for number, (label, box) in layout.rooms.items():
        room = replace(rooms[number - 1], source_label=label, label=label_of(LAYOUTS, label))
        rooms[number - 1] = room if is_placed else place_room(replace(room, floor_area=None), box)
    kept = [e for e in graph.adjacency if not {e.source, e.target} <= set(layout.rooms)]
    storeys = tuple(rooms) if is_placed else find_storeys(rooms)
    laid_out = replace(graph, rooms=storeys, adjacency=tuple(kept))
    return connect(laid_out, layout.connections, method="layout")


@dataclass(frozen=True)
class WithLayouts:
    """A source combined with a folder of room layouts."""

    source: Source  # of the scene graphs
    folder: Path  # with `<scene id>.yaml` or `<hash>.yaml` for some of its scenes

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
            raise SourceError(
                f"{self.folder}: no such folder of room layouts",
                code="source-missing",
                where=self.folder,
            )
        own = self.source.find()
        files = sorted(self.folder.glob("*.yaml"))
        scenes = tuple(self._refer(ref) for ref in own.scenes)
        used = {path for ref in own.scenes if (path := self._layout_of(ref)) is not None}
        if not used:
            raise SourceError(
                f"{self.folder}: none of its {len(files)} layouts belongs to a scene of "
                f"{self.source.path}; expected names like {own.scenes[0].scene_id}.yaml",
                code="layouts-foreign",
                where=self.folder,
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
            return replace(reading, graph=lay_out(reading.graph, read_layout(path)))
        except LayoutError as error:
            require_lasting(error, path)
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
