"""Check the room, the class and the geometry of every object and room."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from functools import partial
from typing import get_args

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from bsg_data.arrays import Bools, Floats, Ints
from bsg_data.checks.part import NULL, Fault, ObjectFaults, Part, Rows
from bsg_data.checks.scenes import repeats
from bsg_data.dataset.manifest import Manifest
from bsg_data.scene.class_map import Classified, Role, load_class_map, published_maps
from bsg_data.scene.class_space import ClassSpace


class ObjectCheck:
    """Check the objects of a dataset part by part.

    Attributes:
        faults: faults of objects, found so far.
    """

    def __init__(self, manifest: Manifest) -> None:
        """Start a check for the dataset of a manifest."""
        self.faults = ObjectFaults()
        self._space: ClassSpace = manifest.class_space

    def add(self, part: Part) -> Iterator[Fault]:
        """Check the objects of a part, and yield faults of its scenes' class maps."""
        self._check_keys(part)
        self._check_classes(part)
        self._check_boxes(part)
        yield from self._check_names(part)

    def _note(self, part: Part, wrong: Bools, what: str) -> None:
        """Keep one fault of some objects `[O]`."""
        if not wrong.any():
            return
        scene, index = part.objects.scene, part.objects.integers("object_index")
        rows = np.flatnonzero(wrong)
        names = (f"{part.scene_ids[scene[row]]}, object {index[row]}" for row in rows[:3])
        self.faults.add(what, names, times=len(rows))

    def _check_keys(self, part: Part) -> None:
        objects = part.objects
        room = objects.integers("room_index")
        limit = part.scenes.integers("num_rooms")[objects.scene]
        self._note(part, (room < 0) | (room > limit), "room_index is not 0..R")
        wrong = repeats(objects.scene, objects.integers("instance_id"))
        self._note(part, wrong, "instance_id is there twice")
        fine = pc.match_substring_regex(objects.table["colour"], "^[0-9A-F]{6}$")
        self._note(part, ~pc.fill_null(fine, True).to_numpy(), "colour is not RRGGBB")

    def _check_classes(self, part: Part) -> None:
        """Check that class and role agree with class_index and category."""
        objects, classes = part.objects, self._space.classes
        index = _class_index(objects)
        outside = index >= len(classes)
        self._note(part, outside, f"class_index is not 0..{len(classes) - 1}")
        place = {name: number for number, name in enumerate(classes)}
        named = objects.words("class").look_up(lambda name: place.get(name, -2), null=NULL)
        wrong = named != np.where(outside, NULL, index)
        self._note(part, wrong, "class is not the name of class_index")
        role, roles = objects.words("role"), get_args(Role)
        odd = role.look_up(lambda name: name not in roles, null=True)
        self._note(part, odd, f"role is none of {roles}")
        wrong = role.is_word("classified") != (index != NULL)
        self._note(part, wrong, "role: expected classified with a class, and only then")
        wrong = role.is_word("unmapped") != ~objects.is_valid("category")
        self._note(part, wrong, "role: expected unmapped without a category, and only then")

    def _check_names(self, part: Part) -> Iterator[Fault]:
        """Check class and role against the published class map of each scene."""
        objects, maps = part.objects, part.scenes.words("class_map")
        for version in sorted({*maps.names} & {*published_maps()}):
            published = load_class_map(version)
            if published.classes != self._space.classes:
                yield Fault("scenes", f"class map {version} is not for {self._space.name}")
                continue
            own = maps.is_word(version)[objects.scene]
            names = objects.words("raw_category")
            known = {name: published.classify(name) for name in names.names}
            index = names.look_up(partial(_find_class, known), null=NULL)
            wrong = own & (index != _class_index(objects))
            self._note(part, wrong, f"class_index is not what {version} says")
            role = names.look_up(partial(_find_role, known), null="")
            wrong = own & (role != objects.words("role").look_up(str, null=""))
            self._note(part, wrong, f"role is not what {version} says")

    def _check_boxes(self, part: Part) -> None:
        """Check that geometry is complete and finite, and centroid and part lie in the box."""
        objects, area = part.objects, part.objects.numbers("area")
        points = read_points(objects, *WHOLES)
        boxed, centred, parted = (
            ~np.isnan(points[name][:, 0]) for name in ("box_min", "centroid", "part_min")
        )
        wrong = boxed != objects.flags("has_geometry")
        self._note(part, wrong, "has_geometry does not agree with the box")
        infinite = np.isinf(np.concatenate(list(points.values()), axis=1)).any(axis=1)
        self._note(part, infinite, "its geometry is not finite")
        for whole in WHOLES:
            wrong = are_partial(*(points[name] for name in whole))
            self._note(part, wrong, f"has only part of its {whole[0].split('_')[0]}")
        bare = boxed & ~centred | parted & ~boxed
        self._note(part, bare, "has a box without a centroid, or a part without a box")
        low, high = points["box_min"], points["box_max"]
        outside = (low > high) | (points["part_min"] > points["part_max"])
        for inner in ("centroid", "part_min", "part_max"):
            outside |= (points[inner] < low - ROUNDING) | (points[inner] > high + ROUNDING)
        for axis, wrong in zip("xyz", outside.T, strict=True):
            self._note(part, wrong, f"its centroid or its part is outside its box in {axis}")
        sound = np.isnan(area) | ((area > 0) & np.isfinite(area))
        self._note(part, ~sound, "area is not above 0")


def _class_index(objects: Rows) -> Ints:
    """Return the class of every object, `[O]`; `NULL` without a class."""
    index = pc.cast(objects.table["class_index"], pa.int64())
    return np.asarray(pc.fill_null(index, NULL).to_numpy())


def _find_class(known: Mapping[str, Classified], name: str) -> int:
    index = known[name].class_index
    return NULL if index is None else index


def _find_role(known: Mapping[str, Classified], name: str) -> Role:
    return known[name].role


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


ROUNDING = 2e-4  # metres: coordinates are rounded, and so are values derived from them
WHOLES = (("centroid",), ("box_min", "box_max"), ("part_min", "part_max"))  # all or nothing


def are_partial(*points: Floats) -> Bools:
    """Say for every row whether some, but not all, coordinates of its points `[n, 3]` are null."""
    null = np.isnan(np.concatenate(points, axis=1))
    number = null.sum(axis=1)
    return np.asarray((number > 0) & (number < null.shape[1]))


def read_points(rows: Rows, *wholes: tuple[str, ...]) -> dict[str, Floats]:
    """Return points `[n, 3]` by their names."""
    return {name: rows.points(name) for whole in wholes for name in whole}
