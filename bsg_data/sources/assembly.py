"""Make scene graphs of what sources read: the one assembler of all sources."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from typing import Any

import numpy as np
import pyarrow as pa

from bsg_data.arrays import Ints
from bsg_data.dataset.scenes import OBJECT_COLUMNS, Objects, spread_boxes, spread_places
from bsg_data.geometry.adjacency import measure_distance
from bsg_data.geometry.placement import find_storeys
from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.room_label import label_of
from bsg_data.scene.scene_graph import Edge, Room, SceneGraph
from bsg_data.scene.surroundings import measure_area
from bsg_data.sources.source import AnnotatedRoom, Annotation, SceneRef


def assemble(
    annotation: Annotation, *, ref: SceneRef, kind: str, class_map: ClassMap
) -> SceneGraph:
    """Make the scene graph of one building.

    A region with an id of 0 or more is a room if it holds an object, or if the source lists it.
    Objects of a negative region belong to the building. Objects that are nameless or outside the
    classes stay, without a class. Rooms are numbered in the order of their regions, objects in that
    of their ids.

    Args:
        annotation: what the source tells of the building.
        ref: the scene.
        kind: of the source.
        class_map: of the source's words.
    """
    described = {room.region: room for room in annotation.rooms}
    regions = np.array(annotation.regions, dtype=np.int64)
    rooms = np.union1d(regions[regions >= 0], np.array([*described], dtype=np.int64))
    room_of = {region: index for index, region in enumerate(rooms.tolist(), start=1)}
    graph = SceneGraph(
        scene_id=ref.scene_id,
        source=kind,
        source_version=ref.source_version,
        source_split=ref.source_split,
        annotation_sha256=annotation.sha256 or ref.fingerprint,
        rooms=_set_levels(
            _make_room(described.get(region) or AnnotatedRoom(region=region), index, kind)
            for region, index in room_of.items()
        ),
        objects=_number_objects(
            annotation, np.where(regions < 0, 0, rooms.searchsorted(regions) + 1), class_map
        ),
        class_map=class_map.version,
        building_kind=annotation.building_kind,
        building=ref.building,
    )
    doors = [(room_of[a], room_of[b]) for a, b in annotation.doors]
    return connect(graph, doors, method=annotation.method) if doors else graph


def _set_levels(rooms: Iterable[Room]) -> tuple[Room, ...]:
    """Return the rooms with the levels that the heights of their floors show, if none has any."""
    listed = tuple(rooms)
    is_told = any(room.floor_index is not None for room in listed)
    is_placed = any(room.floor_z is not None for room in listed)
    return find_storeys(listed) if is_placed and not is_told else listed


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


def place_room(room: Room, annotated: AnnotatedRoom) -> Room:
    """Return a room with its annotated box, and what follows from that."""
    box, area = annotated.box, annotated.floor_area
    if box is None:
        return replace(
            room, centroid=annotated.centroid, footprint=annotated.footprint, floor_area=area
        )
    return replace(
        room,
        box=box,
        centroid=annotated.centroid or box.centre,
        floor_z=box.minimum[2],
        footprint=annotated.footprint or box.footprint,
        floor_area=area if area or annotated.footprint else measure_area(box.footprint),
    )


def _make_room(annotated: AnnotatedRoom, index: int, kind: str) -> Room:
    label = annotated.label or label_of(kind, annotated.source_label)
    room = Room(
        index,
        annotated.region,
        annotated.source_label,
        label=label,
        floor_index=annotated.floor_index,
    )
    return place_room(room, annotated)


def _number_objects(annotation: Annotation, rooms: Ints, class_map: ClassMap) -> Objects:
    """Return the objects, whose rooms `[O]` are known, in the order of their ids."""
    count = len(rooms)
    ids = np.arange(1, count + 1) if annotation.ids is None else np.array(annotation.ids, np.int64)
    order = np.argsort(ids, kind="stable")
    names = pa.array(annotation.names, pa.string()).dictionary_encode()
    known = [class_map.classify(name) for name in names.dictionary.to_pylist()]
    columns = {
        "object_index": 1 + np.argsort(order),
        "instance_id": ids,
        "room_index": rooms,
        "raw_category": names.dictionary.take(names.indices),
        "category": pa.array([entry.category for entry in known], pa.string()).take(names.indices),
        "role": pa.array([entry.role for entry in known], pa.string()).take(names.indices),
        "class_index": pa.array([entry.class_index for entry in known], pa.uint8()).take(
            names.indices
        ),
        "area": pa.nulls(count, pa.float64()),
        "colour": [None] * count if annotation.colours is None else annotation.colours,
        **_spread_places(annotation, count),
    }
    table = pa.table([columns[name] for name in OBJECT_COLUMNS.names], schema=OBJECT_COLUMNS)
    return Objects(table if (order == np.arange(count)).all() else table.take(order))


def _spread_places(annotation: Annotation, count: int) -> dict[str, Any]:
    """Return the columns of places."""
    nowhere = [None] * count
    boxes, parts = annotation.boxes or nowhere, annotation.parts or nowhere
    places = zip(annotation.centroids or nowhere, boxes, strict=True)
    centroids = [point or (box.centre if box else None) for point, box in places]
    return {**spread_places(centroids, boxes), **spread_boxes("part", parts)}
