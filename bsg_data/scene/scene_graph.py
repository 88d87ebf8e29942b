"""The records of a 3D scene graph: one building, its rooms, their objects (paper, section II).

Node indices run over the whole graph: 0 is the building, 1..R the rooms in the order of their
region id, R+1..R+O the objects in the order of their instance id. The nodes of interest 𝒩 are the
first 1+R. Everything is metres, Z up, right-handed.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Literal, NamedTuple

from pydantic import Field

from bsg_data.arrays import Floats
from bsg_data.records import Record
from bsg_data.scene.class_map import Role

Point = tuple[float, float, float]
BUILDING = 0  # index of the building, which holds the objects of the null region
# Graphs for PyG know each by its index here; add new ones at the end.
# A plan says so, a door, stairs, the boxes of two rooms, a robot that went there, or whoever made
# the data.
ADJACENCY_METHODS = ("layout", "door", "stairs", "boxes", "robot", "given")
_FILE_NAME = re.compile(r"[^./\\\x00-\x1f\x7f][^/\\\x00-\x1f\x7f]*")
_LONGEST_ID = 200  # letters; names of files add a suffix


def is_file_name(name: object) -> bool:
    """Say whether a value can name a file of a scene: no path, and no dot first."""
    return isinstance(name, str) and _FILE_NAME.fullmatch(name) is not None


def is_scene_id(name: object) -> bool:
    """Say whether a value can be a scene id: the start of the name of a file."""
    return isinstance(name, str) and len(name) <= _LONGEST_ID and is_file_name(name)


@dataclass(frozen=True, slots=True)
class Box:
    """An axis-aligned box: its lowest and its highest corner (x, y, z), metres."""

    minimum: Point
    maximum: Point

    @property
    def centre(self) -> Point:
        """The middle of the box, metres."""
        x, y, z = ((a + b) / 2 for a, b in zip(self.minimum, self.maximum, strict=True))
        return x, y, z

    @classmethod
    def around(cls, points: Floats) -> Box:
        """Return the box around points `[P, 3]`, one or more."""
        (a, b, c), (d, e, f) = points.min(axis=0).tolist(), points.max(axis=0).tolist()
        return cls((a, b, c), (d, e, f))

    @property
    def footprint(self) -> tuple[tuple[float, float], ...]:
        """The corners of its floor, against the clock, metres."""
        (a, b, _), (c, d, _) = self.minimum, self.maximum
        return (a, b), (c, b), (c, d), (a, d)


class SceneObject(NamedTuple):
    """One object of a scene graph; metres."""

    object_index: int  # 1..O in the order of the instance ids
    instance_id: int  # the id that the annotation gives it
    room_index: int  # its room, 1..R; `BUILDING` for an object of the null region
    raw_category: str  # its name exactly as annotated
    category: str | None = None  # corrected by the class map; None if the name is not in the map
    class_index: int | None = None  # its class by the class map; None without a class
    role: Role = "unmapped"  # by the class map, as `Classified.role`
    colour: str | None = None  # in the semantic mesh as RRGGBB; None if the source has none
    # None without geometry:
    centroid: Point | None = None  # of its surface, weighted by area
    box: Box | None = None  # around all its surface
    area: float | None = None  # of its surface, square metres
    # around the largest connected part of its surface: it leaves out stray paint of the annotator
    part_box: Box | None = None


@dataclass(frozen=True, slots=True)
class Room:
    """One room: a region of the annotation with an id of 0 or more; metres."""

    room_index: int  # 1..R in the order of the region ids
    region_id: int  # the annotation's own id; 0 is a real room
    source_label: str | None = None  # the source's name of the room ("Wohnzimmer", "k")
    # None without geometry:
    centroid: Point | None = None  # centre of its box
    box: Box | None = None  # around the largest parts of its objects without its stairs
    floor_index: int | None = None  # the level, from 0 at the bottom
    floor_z: float | None = None  # height of its floor
    # corners (x, y) of the convex hull of its objects from above, against the clock
    footprint: tuple[tuple[float, float], ...] | None = None
    # the common label of `source_label` (mappings/room-labels-v1.csv); None if unknown
    label: str | None = None
    floor_area: float | None = None  # square metres; None if unknown


def is_placed(node: Room | SceneObject) -> bool:
    """Say whether it is known where a room or an object is."""
    return bool(node.centroid or node.box or getattr(node, "footprint", None))


@dataclass(frozen=True, slots=True)
class Edge:
    """One edge between two nodes; an `adjacent` one is undirected and stored once."""

    source: int  # node index; the parent of a `contains` edge; lower than the target
    target: int  # node index; the child of a `contains` edge
    kind: Literal["contains", "adjacent"]
    # how it is known: `annotation` for containment; of `ADJACENCY_METHODS` for adjacency
    method: str
    distance_m: float | None = None  # between the centroids of two adjacent rooms; None if unknown


@dataclass(frozen=True, slots=True)
class SceneGraph:
    """One building as a 3D scene graph 𝒢; its objects may be columns (`dataset.scenes`)."""

    scene_id: str  # e.g. `00006-HkseAnWCgqk`
    source: str  # the kind of source, e.g. `hm3d`
    source_version: str | None  # e.g. `v0.2`; None if it has none
    source_split: str | None  # the source's own split of the building; None if it has none
    annotation_sha256: str
    rooms: tuple[Room, ...]  # in the order of `room_index`
    objects: Sequence[SceneObject]  # in the order of `object_index`
    adjacency: tuple[Edge, ...] = ()  # sorted; containment follows from the objects
    up_axis: str | None = None  # that points up in the mesh, `y` or `-z`; None without a mesh
    class_map: str = field(kw_only=True)  # the version of the class map of its names
    building_kind: str | None = None  # by the source, e.g. `home` or `office`; None if unknown
    building: str | None = None  # key of the building by the source; None: the scene id

    @property
    def key(self) -> str:
        """The key of the building: two scenes of one key are the same building."""
        return self.building or self.scene_id

    @property
    def has_geometry(self) -> bool:
        """Say whether any room or object has a centroid, a box or a footprint."""
        return any(map(is_placed, self.rooms)) or any(map(is_placed, self.objects))

    def edges(self) -> Iterator[Edge]:
        """Yield building → rooms, rooms → objects, then adjacency."""
        rooms = len(self.rooms)
        for room in self.rooms:
            yield Edge(0, room.room_index, "contains", "annotation")
        for obj in self.objects:
            yield Edge(obj.room_index, rooms + obj.object_index, "contains", "annotation")
        yield from self.adjacency


class MeshCoverage(Record):
    """How much of a mesh its annotation explains."""

    sha256: str = Field(pattern=r"^[0-9a-f]{64}$")
    texels: int = 0  # in all textures, the sum of the next four
    listed: int = 0  # with the exact colour of an instance
    snapped: int = 0  # of JPEG textures that got the nearest instance colour
    black: int = 0  # the background, unless black is the colour of an instance
    unlisted: int = 0  # of any other colour
    unlisted_colours: int = 0  # number of these other colours
    faces: int = 0  # triangles
    area: float = 0.0  # of all triangles, square metres, the sum of the next three
    listed_area: float = 0.0  # of instances
    unlisted_area: float = 0.0  # in colours that no instance has
    uncoloured_area: float = 0.0  # with neither texture nor vertex colours
    without_geometry: int = 0  # listed instances without a surface
