"""Place a scene graph in space: the up axis, the places of objects and rooms, and the storeys.

A mesh is measured in the axes of its file. The glTF standard says Y up, HM3D's configuration says Z
up, and both kinds of files exist. So the labels decide: ceilings are above floors. The result is in
metres, Z up, right-handed.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import chain, pairwise
from typing import TYPE_CHECKING

import numpy as np

from bsg_data.arrays import Floats
from bsg_data.scene.scene_graph import BUILDING, Box, Point, Room, SceneGraph, SceneObject
from bsg_data.scene.surroundings import measure_footprint

if TYPE_CHECKING:
    from bsg_data.geometry.semantic_mesh import MeshSurvey

STOREY_GAP = 1.0  # metres: floors of rooms that are nearer are on one storey,
STOREY_SPAN = 2.0  # as long as none of them is higher than this above the lowest
FLOOR, CEILING = "floor", "ceiling"  # corrected categories
STAIRS = frozenset({"stair", "stair step", "staircase", "stairs"})
_STRAIGHT = 1e-3  # metres
_ASSUMED = "y"  # the glTF standard's, where nothing shows which way is up
# Rows are the x, y and z of the building in the axes of a file in which this axis is up.
UPRIGHT: dict[str, tuple[Point, Point, Point]] = {
    "x": ((0, 1, 0), (0, 0, 1), (1, 0, 0)),
    "y": ((1, 0, 0), (0, 0, -1), (0, 1, 0)),
    "z": ((1, 0, 0), (0, 1, 0), (0, 0, 1)),
    "-x": ((0, 0, 1), (0, 1, 0), (-1, 0, 0)),
    "-y": ((1, 0, 0), (0, 0, 1), (0, -1, 0)),
    "-z": ((1, 0, 0), (0, -1, 0), (0, 0, -1)),
}


def place_scene(graph: SceneGraph, survey: MeshSurvey) -> SceneGraph:
    """Return the scene graph with boxes and storeys, from the survey of its mesh."""
    up_axis = _find_up_axis(graph, survey)
    upright = np.array(UPRIGHT[up_axis])
    boxes, parts = _turn_boxes(survey.box, upright), _turn_boxes(survey.part_box, upright)
    centroids = survey.centroid @ upright.T
    objects = tuple(
        obj
        if survey.area[place] == 0
        else obj._replace(
            centroid=_point(centroids[place]),
            box=_box(boxes[place]),
            area=float(f"{survey.area[place]:.7g}"),
            part_box=_box(parts[place]),
        )
        for place, obj in enumerate(graph.objects)
    )
    cells = _turn_boxes(survey.cells, upright)
    room_of = np.array([_holder(obj) for obj in objects])[survey.owner]
    order = np.argsort(room_of, kind="stable")
    starts = np.searchsorted(room_of[order], [room.room_index for room in graph.rooms])
    _, *held = np.split(cells[order], starts)
    rooms = [_place_room(room, some) for room, some in zip(graph.rooms, held, strict=True)]
    floors: dict[int, list[SceneObject]] = {}
    for obj in objects:
        if obj.category == FLOOR and obj.centroid is not None:
            floors.setdefault(obj.room_index, []).append(obj)
    rooms = [
        replace(room, floor_z=_find_floor(room, floors.get(room.room_index, ()))) for room in rooms
    ]
    return replace(graph, objects=objects, rooms=find_storeys(rooms), up_axis=up_axis)


def _holder(obj: SceneObject) -> int:
    """Return the room whose box an object counts for; stairs, which leave it, count for none."""
    return BUILDING if obj.category in STAIRS else obj.room_index


def _find_up_axis(graph: SceneGraph, survey: MeshSurvey) -> str:
    """Return the axis of the file from floors to ceilings: `x`, `y`, `z`, or one with a minus.

    The median over the rooms that show both decides, or the whole building if no room does. Where
    nothing does, `y` is assumed, as the standard says.
    """
    levels: dict[int, list[int]] = {}  # room → places of its floors and ceilings
    for place, obj in enumerate(graph.objects):
        if obj.category in (FLOOR, CEILING):
            levels.setdefault(obj.room_index, []).append(place)
    steps = [
        step
        for index in range(1, len(graph.rooms) + 1)
        if (step := _floor_to_ceiling(graph, survey, levels.get(index, ()))) is not None
    ]
    whole = _floor_to_ceiling(graph, survey, sorted(chain.from_iterable(levels.values())))
    if not steps and whole is None:
        return _ASSUMED
    step = np.median(steps, axis=0) if steps else np.asarray(whole)
    axis = int(np.abs(step).argmax())
    return ("-" if step[axis] < 0 else "") + "xyz"[axis]


def _floor_to_ceiling(
    graph: SceneGraph, survey: MeshSurvey, places: Sequence[int]
) -> Floats | None:
    """Return the way from the middle of the floors to that of the ceilings `[3]`."""
    middles = []
    for category in (FLOOR, CEILING):
        chosen = [place for place in places if graph.objects[place].category == category]
        weights = survey.area[chosen]
        if not weights.sum() > 0:
            return None
        centroids = np.nan_to_num(survey.centroid[chosen])
        middles.append(weights @ centroids / weights.sum())
    return np.asarray(middles[1] - middles[0])


def _place_room(room: Room, cells: Floats) -> Room:
    """Return the room with the box and the footprint of the cells `[P, 2, 3]` of its objects."""
    if not len(cells):
        return room
    box = _box(np.stack([cells[:, 0].min(axis=0), cells[:, 1].max(axis=0)]))
    centre = np.mean([box.minimum, box.maximum], axis=0)
    corners = [cells[:, [x, y], [0, 1]] for x in (0, 1) for y in (0, 1)]
    footprint = surround(np.concatenate(corners))
    return replace(
        room,
        box=box,
        centroid=_point(centre),
        footprint=footprint,
        floor_area=measure_area(footprint),
    )


def measure_area(corners: Sequence[tuple[float, float]]) -> float | None:
    """Return the area of a polygon (x, y) in square metres; None if it has none."""
    area = measure_footprint(corners)
    return None if area is None else _round(area) or None


def surround(points: Floats) -> tuple[tuple[float, float], ...]:
    """Return the corners of the convex hull of points `[P, 2]`, against the clock.

    Points on one line, which have no hull, give the corners of the rectangle around them.
    """
    from scipy.spatial import (  # Imported here because importing SciPy is slow.
        ConvexHull,
        QhullError,
    )

    try:
        corners = _straighten(points[ConvexHull(points).vertices])
    except (QhullError, ValueError):
        (a, b), (c, d) = points.min(axis=0), points.max(axis=0)
        corners = np.array([[a, b], [c, b], [c, d], [a, d]])
    return tuple((_round(x), _round(y)) for x, y in corners)


def _straighten(corners: Floats) -> Floats:
    """Leave corners out that stand less than a millimetre off the line of their neighbours."""
    kept: list[int] = []
    last = left = len(corners)
    for number in range(last):
        before = kept[-1] if kept else last - 1
        after = number + 1 if number + 1 < last else kept[0]
        (ax, ay), (bx, by), (cx, cy) = (corners[one] for one in (before, number, after))
        off = abs((cx - ax) * (by - ay) - (cy - ay) * (bx - ax))
        if left > 3 and off < _STRAIGHT * np.hypot(cx - ax, cy - ay):
            left -= 1
        else:
            kept.append(number)
    return corners[kept]


def find_storeys(rooms: Sequence[Room]) -> tuple[Room, ...]:
    """Return the rooms with their levels, from 0 at the bottom, by gaps between their floors."""
    known = sorted(room.floor_z for room in rooms if room.floor_z is not None)
    starts = known[:1]
    for below, height in pairwise(known):
        if height - below > STOREY_GAP or height - starts[-1] > STOREY_SPAN:
            starts.append(height)
    return tuple(
        room
        if room.floor_z is None
        else replace(room, floor_index=int(np.searchsorted(starts, room.floor_z, side="right")) - 1)
        for room in rooms
    )


def _find_floor(room: Room, floors: Sequence[SceneObject]) -> float | None:
    """Return the height of a room's floor: of the surfaces so named, else of its lowest point."""
    named = [(obj.area, obj.centroid[2]) for obj in floors if obj.centroid is not None]
    if room.box is None:
        return None
    if named:
        areas, heights = zip(*named, strict=True)
        return _round(np.average(heights, weights=areas))
    return room.box.minimum[2]


def _turn_boxes(boxes: Floats, upright: Floats) -> Floats:
    """Return boxes `[B, 2, 3]` in other axes, corners in order again."""
    places = np.abs(upright).argmax(axis=1)  # of 1 or -1 in each row; threads make `@` slow
    one, other = (boxes[:, end, places] * upright.sum(axis=1) for end in (0, 1))
    return np.stack([np.minimum(one, other), np.maximum(one, other)], axis=1)


def _point(values: Floats) -> Point:
    x, y, z = map(_round, values.tolist())
    return x, y, z


def _round(metres: float) -> float:
    """Return a length to a tenth of a millimetre: coordinates in files have seven digits."""
    return round(float(metres), 4) + 0.0  # and never -0.0


def _box(corners: Floats) -> Box:
    return Box(_point(corners[0]), _point(corners[1]))
