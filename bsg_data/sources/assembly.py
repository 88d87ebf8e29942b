"""Make scene graphs of what sources read: the one assembler of all sources."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from operator import attrgetter

from bsg_data.geometry.adjacency import measure_distance
from bsg_data.scene.class_map import Classified, ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import (
    BUILDING,
    AnnotatedObject,
    Box,
    Edge,
    Room,
    SceneGraph,
    SceneObject,
)
from bsg_data.scene.surroundings import measure_area
from bsg_data.sources.source import SceneRef


def assemble(
    objects: Iterable[AnnotatedObject],
    *,
    ref: SceneRef,
    kind: str,
    class_map: ClassMap,
    sha256: str | None = None,
    rooms: Iterable[Room] = (),
    doors: Iterable[tuple[int, int]] = (),
    method: str = "given",
    building_kind: str | None = None,
) -> SceneGraph:
    """Make the scene graph of one building.

    A region with an id of 0 or more is a room if it holds an object, or if the source lists it.
    Objects of a negative region belong to the building. Objects that are nameless or outside the
    classes stay, without a class.

    Args:
        objects: as annotated; they are numbered and classified here.
        ref: the scene.
        kind: of the source.
        class_map: of the source's words.
        sha256: hash of the annotation; None if that is the fingerprint.
        rooms: what the source tells of some of its rooms, each by its region id; they are numbered
            here, and get the common label of their source label.
        doors: region ids of rooms that connect, in any order; a pair may be there twice.
        method: how the source knows of these, e.g. `door`.
        building_kind: what the source says of the building, e.g. `office`.
    """
    listed = sorted(objects, key=attrgetter("instance_id"))
    told = {room.region_id: room for room in rooms}
    regions = sorted({o.region_id for o in listed if o.region_id >= 0} | set(told))
    room_of = {region: index for index, region in enumerate(regions, start=1)}
    graph = SceneGraph(
        scene_id=ref.scene_id,
        source=kind,
        source_version=ref.source_version,
        source_split=ref.source_split,
        annotation_sha256=sha256 or ref.fingerprint,
        rooms=tuple(
            _number_room(told.get(region, Room(index, region)), index, kind)
            for region, index in room_of.items()
        ),
        objects=tuple(_number_objects(listed, room_of, class_map)),
        class_map=class_map.version,
        building_kind=building_kind,
        building=ref.building,
    )
    return connect(graph, [(room_of[a], room_of[b]) for a, b in doors], method=method)


def connect(graph: SceneGraph, pairs: Iterable[tuple[int, int]], *, method: str) -> SceneGraph:
    """Return the scene graph with further connections, which replace those of the same rooms.

    Args:
        graph: with all its rooms, and where they are.
        pairs: room indices, in any order; a pair may be there twice.
        method: how they are known, e.g. `door`.
    """
    edges = {(edge.source, edge.target): edge for edge in graph.adjacency}
    for a, b in map(sorted, pairs):
        length = measure_distance(graph.rooms[a - 1], graph.rooms[b - 1])
        edges[a, b] = Edge(a, b, "adjacent", method, length)
    return replace(graph, adjacency=tuple(edges[pair] for pair in sorted(edges)))


def place_room(room: Room, box: Box) -> Room:
    """Return a room with a box, and what follows from it: centroid, floor, footprint and area.

    An area that the source tells stays.
    """
    return replace(
        room,
        box=box,
        centroid=box.centre,
        floor_z=box.minimum[2],
        footprint=box.footprint,
        floor_area=room.floor_area or measure_area(box.footprint),
    )


def _number_room(room: Room, index: int, kind: str) -> Room:
    return replace(room, room_index=index, label=room.label or label_of(kind, room.source_label))


def _number_objects(
    listed: Iterable[AnnotatedObject], room_of: Mapping[int, int], class_map: ClassMap
) -> Iterator[SceneObject]:
    classified: dict[str, Classified] = {}
    for index, obj in enumerate(listed, start=1):
        instance, region, name, colour, centroid, box, area, part_box = obj
        known = classified.get(name) or classified.setdefault(name, class_map.classify(name))
        yield SceneObject(
            index,
            instance,
            room_of.get(region, BUILDING),
            name,
            known.category,
            known.class_index,
            known.role,
            colour,
            centroid,
            box,
            area,
            part_box,
        )
