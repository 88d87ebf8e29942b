"""Make scene graphs from lists of annotated instances."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from bsg_data.geometry.adjacency import measure_distance
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import Edge, Room, SceneGraph, SceneObject
from bsg_data.sources.annotations import Annotation, Instance
from bsg_data.sources.source import SceneRef


def assemble(
    annotation: Annotation,
    *,
    ref: SceneRef,
    kind: str,
    class_map: ClassMap,
    rooms: Iterable[Room] = (),
    building_kind: str | None = None,
) -> SceneGraph:
    """Make the scene graph of one annotation.

    A region with an id of 0 or more is a room if it holds an instance, or if the source lists it.
    Objects of the null region belong to the building. Objects that are nameless or outside the
    classes stay, without a class.

    Args:
        annotation: its instances.
        ref: the scene.
        kind: of the source.
        class_map: of the source's words.
        rooms: what the source tells of some of its rooms, each by its region id; they are numbered
            here, and get the common label of their source label.
        building_kind: what the source says of the building, e.g. `office`.
    """
    told = {room.region_id: room for room in rooms}
    regions = sorted({i.region_id for i in annotation.instances if i.region_id >= 0} | set(told))
    room_of = {region: index for index, region in enumerate(regions, start=1)}
    return SceneGraph(
        scene_id=ref.scene_id,
        source=kind,
        source_version=ref.source_version,
        source_split=ref.source_split,
        annotation_sha256=annotation.sha256,
        rooms=tuple(
            _describe(told.get(region, Room(index, region)), index, kind)
            for region, index in room_of.items()
        ),
        objects=tuple(
            _classify(instance, index, room_of.get(instance.region_id, 0), class_map)
            for index, instance in enumerate(annotation.instances, start=1)
        ),
        class_map=class_map.version,
        building_kind=building_kind,
    )


def connect_regions(
    graph: SceneGraph, pairs: Iterable[tuple[int, int]], *, method: str
) -> SceneGraph:
    """Return the scene graph with the connections that its source tells of.

    Args:
        graph: with all its rooms, and where they are.
        pairs: region ids of rooms that connect, in any order; a pair may be there twice.
        method: how the source knows, e.g. `door`.
    """
    room_of = {room.region_id: room.room_index for room in graph.rooms}
    found = {tuple(sorted((room_of[one], room_of[other]))) for one, other in pairs}
    edges = tuple(
        Edge(a, b, "adjacent", method, measure_distance(graph.rooms[a - 1], graph.rooms[b - 1]))
        for a, b in sorted(found)
    )
    return replace(graph, adjacency=edges)


def _describe(room: Room, index: int, kind: str) -> Room:
    return replace(room, room_index=index, label=room.label or label_of(kind, room.source_label))


def _classify(instance: Instance, index: int, room: int, class_map: ClassMap) -> SceneObject:
    known = class_map.classify(instance.name)
    return SceneObject(
        object_index=index,
        instance_id=instance.instance_id,
        room_index=room,
        raw_category=instance.name,
        category=known.category,
        class_index=known.class_index,
        role=known.role,
        colour=instance.colour,
        centroid=instance.centroid,
        box=instance.box,
    )
