"""Check boxes, footprints and storeys of rooms, and the geometry columns of scenes."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bsg_data.arrays import Bools, Floats
from bsg_data.checks.faults import Fault
from bsg_data.checks.part import Part, Rows
from bsg_data.checks.places import ROUNDING, WHOLES, are_partial, read_points

_AXES = ("x", "y", "z", "-x", "-y", "-z")


def check_rooms(part: Part) -> Iterator[Fault]:
    """Check the rooms of a part, and the geometry columns of its scenes."""
    rooms = part.rooms
    points = read_points(rooms, *WHOLES[:2])
    for row in np.flatnonzero(_are_impossible(rooms, points)):
        scene, room = part.scene_ids[rooms.scene[row]], rooms.table["room_index"][row].as_py()
        yield Fault("rooms", f"{scene}, room {room}: its geometry is impossible")
    yield from _check_scenes(part, ~np.isnan(points["centroid"][:, 0]))


def _are_impossible(rooms: Rows, points: dict[str, Floats]) -> Bools:
    centre, low, high = (points[name] for name in ("centroid", "box_min", "box_max"))
    area, storey = rooms.numbers("floor_area"), rooms.numbers("floor_index")
    wrong: Bools = np.isinf(np.concatenate([centre, low, high], axis=1)).any(axis=1)
    wrong |= np.isinf(rooms.numbers("floor_z")) | np.isinf(area)
    wrong |= are_partial(centre) | are_partial(low, high)
    wrong |= ~np.isnan(low[:, 0]) & np.isnan(centre[:, 0])
    wrong |= (storey < 0) | (area <= 0)
    with np.errstate(invalid="ignore"):  # infinite values are found above
        wrong |= (low > high).any(axis=1)
        wrong |= (np.abs(centre - (low + high) / 2) > ROUNDING).any(axis=1)
    drawn = np.flatnonzero(rooms.is_valid("footprint"))
    boxes = np.concatenate([low[drawn, :2], high[drawn, :2]], axis=1)
    for row, box in zip(drawn, boxes, strict=True):
        wrong[row] |= not _fills(rooms.table["footprint"][row].values.to_numpy(), box)
    return wrong


def _fills(footprint: Floats, box: Floats) -> bool:
    """Say whether a footprint is a polygon that fills a box `[4]` from above.

    Without a box any polygon is right. A room with a box may have no footprint.
    """
    if len(footprint) < 6 or len(footprint) % 2 or not np.isfinite(footprint).all():
        return False
    corners = footprint.reshape(-1, 2)
    ends = np.array([*corners.min(axis=0), *corners.max(axis=0)])
    return bool(np.isnan(box).all() or (np.abs(ends - box) <= 10 * ROUNDING).all())


def _check_scenes(part: Part, has_centre: Bools) -> Iterator[Fault]:
    """Check the geometry columns of scenes; `has_centre` `[R]` belongs to the rooms."""
    scenes, rooms, objects = part.scenes, part.rooms, part.objects
    axis = scenes.words("up_axis")
    for row in np.flatnonzero(axis.look_up(lambda name: name not in _AXES, null=False)):
        yield Fault("scenes", f"{part.scene_ids[row]}: up_axis is none of {', '.join(_AXES)}")
    placed = np.zeros(len(scenes), dtype=bool)
    placed[rooms.scene[has_centre | rooms.is_valid("footprint")]] = True
    placed[objects.scene[~np.isnan(objects.numbers("centroid_x"))]] = True
    for row in np.flatnonzero(placed != scenes.flags("has_geometry")):
        scene = part.scene_ids[row]
        yield Fault("scenes", f"{scene}: has_geometry does not agree with rooms and objects")
