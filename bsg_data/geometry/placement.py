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
import numpy.typing as npt

from bsg_data.arrays import Floats, Ints, find_runs
from bsg_data.geometry.surfaces import CELL
from bsg_data.scene.scene_graph import BUILDING, Box, Point, Room, SceneGraph, SceneObject
from bsg_data.scene.surroundings import measure_area

if TYPE_CHECKING:
    from bsg_data.geometry.semantic_mesh import MeshSurvey

_STOREY_GAP = 1.0  # metres: floors of rooms that are nearer are on one storey,
_STOREY_SPAN = 2.0  # as long as none of them is higher than this above the lowest
FLOOR, CEILING = "floor", "ceiling"  # corrected categories
STAIRS = frozenset({"stair", "stair step", "staircase", "stairs"})
_STRAIGHT = 1e-3  # metres
Polygon = tuple[tuple[float, float], ...]  # corners (x, y), metres, against the clock
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
    boxes, parts = (
        _round(_turn_boxes(measured, upright)) for measured in (survey.box, survey.part_box)
    )
    places = zip(
        graph.objects,
        survey.area.tolist(),
        _round(survey.centroid @ upright.T).tolist(),
        boxes.tolist(),
        parts.tolist(),
        strict=True,
    )
    objects = tuple(
        obj._replace(
            centroid=(x, y, z), box=_box(box), area=float(f"{area:.7g}"), part_box=_box(part)
        )
        if area
        else obj
        for obj, area, (x, y, z), box, part in places
    )
    room_of = np.array([_holder(obj) for obj in objects])
    shapes = _surround_rooms(_turn_boxes(survey.cells, upright), room_of[survey.owner])
    of_rooms = _join_boxes(parts, room_of)
    rooms = [
        _place_room(room, of_rooms[room.room_index], shapes[room.room_index])
        if room.room_index in shapes
        else room
        for room in graph.rooms
    ]
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


def _surround_rooms(cells: Floats, room_of: Ints) -> dict[int, Polygon]:
    """Return the convex hull from above of the cells `[P, 2, 3]` of every room that has some.

    Cells one above another are taken as one.
    """
    corners = cells[:, :, :2]
    place = np.floor(corners.mean(axis=1) / CELL).astype(np.int64) + 2**15
    columns = room_of << 32 | place[:, 0] << 16 | place[:, 1]
    order = np.argsort(columns, kind="stable")
    starts, named = find_runs(columns[order])
    if not len(starts):
        return {}
    low = np.minimum.reduceat(corners[order, 0], starts)
    high = np.maximum.reduceat(corners[order, 1], starts)
    mixed = np.stack([low[:, 0], high[:, 1]], axis=1), np.stack([high[:, 0], low[:, 1]], axis=1)
    four = np.stack([low, *mixed, high], axis=1)
    firsts, rooms = find_runs(named >> 32)
    held = np.split(four.reshape(-1, 2), 4 * firsts[1:])
    return {room: surround(some) for room, some in zip(rooms.tolist(), held, strict=True)}


def _join_boxes(boxes: Floats, room_of: Ints) -> dict[int, Box]:
    """Return the box around the known boxes `[O, 2, 3]` of every room that has some."""
    is_known = np.isfinite(boxes[:, 0, 0])
    boxes, room_of = boxes[is_known], room_of[is_known]
    held = ((room, boxes[room_of == room]) for room in np.unique(room_of).tolist())
    return {room: Box.around(some.reshape(-1, 3)) for room, some in held}


def _place_room(room: Room, box: Box, footprint: Polygon) -> Room:
    return replace(
        room,
        box=box,
        centroid=_point(box.centre),
        footprint=footprint,
        floor_area=measure_area(footprint),
    )


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
    return tuple((x, y) for x, y in _round(corners).tolist())


def _straighten(corners: Floats) -> Floats:
    """Leave corners out that stand less than a millimetre off the line of their neighbours."""
    straight: list[int] = []
    last = left = len(corners)
    for number in range(last):
        before = straight[-1] if straight else last - 1
        after = number + 1 if number + 1 < last else straight[0]
        (ax, ay), (bx, by), (cx, cy) = (corners[place] for place in (before, number, after))
        off = abs((cx - ax) * (by - ay) - (cy - ay) * (bx - ax))
        if left > 3 and off < _STRAIGHT * np.hypot(cx - ax, cy - ay):
            left -= 1
        else:
            straight.append(number)
    return corners[straight]


def find_storeys(rooms: Sequence[Room]) -> tuple[Room, ...]:
    """Return the rooms with their levels, from 0 at the bottom, by gaps between their floors."""
    known = sorted(room.floor_z for room in rooms if room.floor_z is not None)
    starts = known[:1]
    for below, height in pairwise(known):
        if height - below > _STOREY_GAP or height - starts[-1] > _STOREY_SPAN:
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
        return float(_round(np.average(heights, weights=areas)))
    return room.box.minimum[2]


def _turn_boxes(boxes: Floats, upright: Floats) -> Floats:
    """Return boxes `[B, 2, 3]` in other axes, corners in order again."""
    places = np.abs(upright).argmax(axis=1)  # of 1 or -1 in each row; threads make `@` slow
    first, second = (boxes[:, end, places] * upright.sum(axis=1) for end in (0, 1))
    return np.stack([np.minimum(first, second), np.maximum(first, second)], axis=1)


def _round(metres: npt.ArrayLike) -> Floats:
    """Return lengths to a tenth of a millimetre: coordinates in files have seven digits."""
    return np.round(np.asarray(metres, dtype=float), 4) + 0.0  # and never -0.0


def _point(values: npt.ArrayLike) -> Point:
    x, y, z = _round(values).tolist()
    return x, y, z


def _box(corners: list[list[float]]) -> Box:
    (a, b, c), (d, e, f) = corners
    return Box((a, b, c), (d, e, f))
