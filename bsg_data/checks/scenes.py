"""Check that the tables of a part hold the same scenes, with the stated numbers of rows."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from bsg_data.arrays import Bools, Ints
from bsg_data.checks.faults import Fault
from bsg_data.checks.part import NULL, Part, Rows


def check_scenes(part: Part) -> Iterator[Fault]:
    """Check the order and the numbering of the rows, and the counts that scenes state."""
    for name in ("rooms", "objects", "edges"):
        scene = getattr(part, name).scene
        if (scene == NULL).any() or (np.diff(scene) < 0).any():
            yield Fault(name, f"part {part.number} has rows of other scenes, or in another order")
    classified = ~np.isnan(part.objects.numbers("class_index"))
    for column, scene in (
        ("num_rooms", part.rooms.scene),
        ("num_objects", part.objects.scene),
        ("num_classified", part.objects.scene[classified]),
    ):
        counted = _count_rows(scene, scenes=len(part.scenes))
        stated = part.scenes.integers(column)
        for row in np.flatnonzero(stated != counted):
            found = f"{column}: expected {counted[row]}, found {stated[row]}"
            yield Fault("scenes", f"{part.scene_ids[row]}: {found}")
    rooms, region = part.rooms, part.rooms.integers("region_id")
    falls = region < 0
    falls[1:] |= (np.diff(rooms.scene) == 0) & (np.diff(region) <= 0)
    for scene in part.name_scenes(rooms, falls):
        yield Fault("rooms", f"{scene}: region_id does not rise from 0 or more")
    for name, key in (("rooms", "room_index"), ("objects", "object_index")):
        rows: Rows = getattr(part, name)
        odd = rows.integers(key) != _number_rows(rows.scene, scenes=len(part.scenes))
        for scene in part.name_scenes(rows, odd):
            yield Fault(name, f"{scene}: {key} does not run 1, 2, 3, …")


def _count_rows(scene: Ints, *, scenes: int) -> Ints:
    """Return the number of rows of each scene, `[scenes]`, from the scene of every row."""
    return np.bincount(scene[scene != NULL], minlength=scenes)


def _number_rows(scene: Ints, *, scenes: int) -> Ints:
    """Return the number of every row within its scene, from 1, in any order of rows."""
    order = np.argsort(scene, kind="stable")
    first = np.searchsorted(scene[order], np.arange(NULL, scenes))
    places = np.empty(len(scene), dtype=np.int64)
    places[order] = np.arange(1, len(scene) + 1) - first[scene[order] - NULL]
    return places


def repeats(scene: Ints, *keys: Ints) -> Bools:
    """Say for every row whether an earlier row has the same scene and keys, `[n]`."""
    columns = (*keys, scene)
    order = np.lexsort(columns)  # stable: equal rows keep their order
    alike = np.ones(max(len(scene) - 1, 0), dtype=bool)
    for column in columns:
        alike &= np.diff(column[order]) == 0
    again = np.zeros(len(scene), dtype=bool)
    again[order[1:]] = alike
    return again
