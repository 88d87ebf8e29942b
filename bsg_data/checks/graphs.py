"""Rules that every scene graph keeps, whatever its source."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator

from bsg_data.scene.class_map import ClassMap
from bsg_data.scene.scene_graph import (
    ADJACENCY_METHODS,
    Box,
    Edge,
    Point,
    Room,
    SceneGraph,
    SceneObject,
)

_COLOUR = re.compile("[0-9A-F]{6}")
_AXES = ("x", "y", "z", "-x", "-y", "-z")
_ROUNDING = 2e-4  # metres: coordinates are rounded, and so are values derived from them
_Fault = tuple[str, str, str]
_Reading = tuple[str, str | None, int | None, str]  # name, category, class and role of an object


def find_faults(graph: SceneGraph, class_map: ClassMap | None = None) -> Iterator[_Fault]:
    """Yield the faults of a scene graph: table, what is at fault in the scene, and the rule.

    Args:
        graph: the scene graph.
        class_map: that it was read with; None: names and classes are not compared.
    """
    if graph.up_axis is not None and graph.up_axis not in _AXES:
        yield "scenes", "", f"up_axis is none of {', '.join(_AXES)}"
    before, sound = -1, True
    for number, room in enumerate(graph.rooms, start=1):
        for rule in _find_room_faults(room, number, before):
            sound = False
            yield "rooms", f"room {room.room_index}", rule
        before = room.region_id
    instance: int | None = None
    misread = frozenset[_Reading]() if class_map is None else _find_misread(graph, class_map)
    for number, obj in enumerate(graph.objects, start=1):
        for rule in _find_object_faults(obj, number, instance, rooms=len(graph.rooms)):
            yield "objects", f"object {obj.object_index}", rule
        if misread and class_map is not None and _reading_of(obj) in misread:
            rule = f"category, class or role is not what {class_map.version} says"
            yield "objects", f"object {obj.object_index}", rule
        instance = obj.instance_id
    last = (0, 0)
    for edge in graph.adjacency if sound else ():
        for rule in _find_edge_faults(edge, last, graph.rooms):
            yield "edges", f"rooms {edge.source} and {edge.target}", rule
        last = edge.source, edge.target


def _find_room_faults(room: Room, number: int, before: int) -> Iterator[str]:
    """Yield the faults of the room with a number, after one with the region id `before`."""
    if room.room_index != number:
        yield "room_index does not run 1, 2, 3, …"
    if room.region_id <= before:
        yield "region_id does not rise from 0 or more"
    centre, box, footprint = room.centroid, room.box, room.footprint
    heights = [] if room.floor_z is None else [room.floor_z]
    if not (
        _are_finite(centre, heights, *(footprint or ()))
        and (room.floor_index is None or room.floor_index >= 0)
        and _is_area(room.floor_area)
        and (box is None or (_is_box(box) and _is_near(centre, box.centre)))
        and (footprint is None or _fills(footprint, box))
    ):
        yield "its geometry is impossible"


def _find_object_faults(
    obj: SceneObject, number: int, before: int | None, *, rooms: int
) -> Iterator[str]:
    """Yield the faults of the object with a number, after one with the instance id `before`."""
    if obj.object_index != number:
        yield "object_index does not run 1, 2, 3, …"
    if before is not None and obj.instance_id <= before:
        yield "instance_id does not rise"
    if not 0 <= obj.room_index <= rooms:
        yield "room_index is not 0..R"
    if obj.colour is not None and not _COLOUR.fullmatch(obj.colour):
        yield "colour is not RRGGBB"
    if not _is_area(obj.area):
        yield "area is not above 0"
    box, part = obj.box, obj.part_box
    is_placed = not (obj.centroid is None and box is None and part is None)
    if is_placed and not (
        _are_finite(obj.centroid)
        and (box is None or (_is_box(box) and _is_inside(obj.centroid, box)))
        and (part is None or (_is_box(part) and _is_inside(part.minimum, box)))
        and (part is None or _is_inside(part.maximum, box))
    ):
        yield "its centroid, its box or its largest part is impossible"


def _find_edge_faults(edge: Edge, last: tuple[int, int], rooms: tuple[Room, ...]) -> Iterator[str]:
    """Yield the faults of an adjacent edge after another one."""
    if not (1 <= edge.source < edge.target <= len(rooms)) or (edge.source, edge.target) <= last:
        yield "an adjacent edge must join two rooms, lower index first, once, in order"
        return
    ends = rooms[edge.source - 1].centroid, rooms[edge.target - 1].centroid
    known = None if ends[0] is None or ends[1] is None else math.dist(ends[0], ends[1])
    found = edge.distance_m
    if edge.method not in ADJACENCY_METHODS or not (
        known == found
        if known is None or found is None
        else math.isclose(known, found, rel_tol=1e-5)
    ):
        yield "an adjacent edge has an unknown method or distance"


def _find_misread(graph: SceneGraph, class_map: ClassMap) -> frozenset[_Reading]:
    """Return how names are read whose category, class or role is not what a map says."""
    read = {*map(_reading_of, graph.objects)}
    return frozenset(one for one in read if _classify(one[0], class_map) != one)


def _reading_of(obj: SceneObject) -> _Reading:
    return obj.raw_category, obj.category, obj.class_index, obj.role


def _classify(name: str, class_map: ClassMap) -> _Reading:
    known = class_map.classify(name)
    return name, known.category, known.class_index, known.role


def _are_finite(*points: Point | tuple[float, float] | list[float] | None) -> bool:
    """Say whether all coordinates are there, and finite; no point is fine."""
    values = (value for point in points if point is not None for value in point)
    return all(value is not None and math.isfinite(value) for value in values)


def _is_area(area: float | None) -> bool:
    return area is None or 0 < area < math.inf


def _is_box(box: Box) -> bool:
    corners = box.minimum, box.maximum
    return _are_finite(*corners) and all(a <= b for a, b in zip(*corners, strict=True))


def _is_near(point: Point | None, other: Point) -> bool:
    return point is not None and all(
        abs(a - b) <= _ROUNDING for a, b in zip(point, other, strict=True)
    )


def _is_inside(point: Point | None, box: Box | None) -> bool:
    if point is None or box is None:
        return False
    sides = zip(box.minimum, point, box.maximum, strict=True)
    return all(low - _ROUNDING <= value <= high + _ROUNDING for low, value, high in sides)


def _fills(footprint: tuple[tuple[float, float], ...], box: Box | None) -> bool:
    """Say whether a footprint is a polygon that fills a box, if there is one, from above."""
    if len(footprint) < 3:
        return False
    xs, ys = zip(*footprint, strict=True)
    ends = min(xs), min(ys), max(xs), max(ys)
    sides = ends if box is None else (*box.minimum[:2], *box.maximum[:2])
    return all(abs(a - b) <= 10 * _ROUNDING for a, b in zip(ends, sides, strict=True))
